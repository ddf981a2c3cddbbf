"""The search for inputs that break something: ``python -m tests.fuzz TARGET... --seconds N``.

A target is a reader of bytes, fuzzed with atheris guided by coverage (``all``: every reader), or ``properties``: all
hypothesis tests, with new random examples in every round. The targets share the N seconds; ``properties`` gets half.

A find of a reader stops that target, prints its traceback and leaves its bytes in ``out/fuzz``. Once mended it goes
into ``finds.py``, and every test run reads it again. A find of a property is printed with the decorator that repeats it
(``@reproduce_failure``) and is tried first in the next search; once mended it becomes an ``@example`` of its test.
``--runs N`` stops a reader after as many tries; ``--seed N`` makes the same ones again.
``--watch PACKAGE...`` chooses what is watched for coverage; fewer packages start sooner.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.util
import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from companion.cli import kernel_cache

if TYPE_CHECKING:
    from tests.fuzz.targets import Target

ROOT = Path(__file__).resolve().parents[2]
FOUND = Path("out/fuzz")
WATCHED = ("companion", "tomllib", "yaml", "json", "pymavlink")
"""Packages that are looked into: which of their branches are taken. For pymavlink that takes half of the start."""
PROPERTIES = "properties"
SAID = ("stat::number_of_executed_units", "Done ")


def compiled_modules() -> list[str]:
    """Modules with kernels. They are not watched: numba would have to compile what atheris adds to them."""
    files = (ROOT / "companion").rglob("*.py")
    found = [path for path in files if re.search(r"^(from|import) numba\b", path.read_text(), re.MULTILINE)]
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in found)


def watched_targets(packages: Sequence[str]) -> Mapping[str, Target]:
    """All targets, with these packages watched."""
    import atheris

    quiet = contextlib.redirect_stderr(io.StringIO())  # a line for each module
    with quiet, atheris.instrument_imports(include=packages, exclude=compiled_modules()):
        from tests.fuzz.targets import targets

        return targets()


def run(name: str, target: Target, corpus: Path, limits: list[str]) -> None:
    """Fuzz one target in this process, which ends with it."""
    import atheris

    for number, example in enumerate(target.examples):
        (corpus / f"{number}").write_bytes(example)
        target.read(example)  # compiles what has to be; later it would count as a hang
    always = [f"-timeout={target.most_s}", "-rss_limit_mb=2500", "-max_len=65536", "-print_final_stats=1"]

    def read(data: bytes) -> None:
        try:
            target.read(data)
        except BaseException:
            (FOUND / f"{name}-{hashlib.sha256(data).hexdigest()[:16]}").write_bytes(data)
            raise

    atheris.Setup([name, *always, *limits, f"-artifact_prefix={FOUND}/{name}-", str(corpus)], read)
    atheris.Fuzz()


def is_clean(name: str, target: Target, limits: list[str]) -> bool:
    """Fuzz one target in a process of its own and tell what came of it; whether nothing was found."""
    with tempfile.TemporaryDirectory(prefix="fuzz") as folder:
        log, corpus = Path(folder) / "log", Path(folder) / "corpus"
        corpus.mkdir()
        child = os.fork()
        if not child:
            try:
                with log.open("wb") as file:
                    os.dup2(file.fileno(), 1)
                    os.dup2(file.fileno(), 2)
                run(name, target, corpus, limits)
            except BaseException:
                traceback.print_exc()
            os._exit(1)  # libFuzzer ends its process itself
        clean = os.waitpid(child, 0)[1] == 0
        lines = log.read_text(errors="replace").splitlines()
    figures = " ".join(line for line in lines if line.startswith(SAID))
    print(f"{name}: {'nothing found' if clean else 'FOUND'} {figures}", flush=True)
    if not clean:
        print("\n".join(lines[-60:]), flush=True)
    return clean


def properties_hold(seconds: float) -> bool:
    """Run all hypothesis tests, again and again with other examples, for so long; whether all passed."""
    stop_s, rounds = time.monotonic() + seconds, 0
    command = [sys.executable, "-m", "pytest", "tests", "-m", "hypothesis", "-n", str(os.cpu_count()), "--tb=short"]
    environment = {**os.environ, "HYPOTHESIS_PROFILE": "search"}
    while time.monotonic() < stop_s:
        with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as child:
            try:
                said, _ = child.communicate(timeout=stop_s - time.monotonic())
            except subprocess.TimeoutExpired:
                child.send_signal(signal.SIGINT)
                said, _ = child.communicate()
        if child.returncode not in (0, pytest.ExitCode.INTERRUPTED) or "FAILED" in said:
            print(f"properties: FOUND\n{said}", flush=True)
            return False
        rounds += 1
    print(f"properties: nothing found in {rounds} rounds", flush=True)
    return True


def main() -> None:
    """The command line; exit code 1 after a find."""
    parser = argparse.ArgumentParser(prog="tests.fuzz")
    parser.add_argument("targets", nargs="+")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--runs", type=int, default=-1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--watch", nargs="+", default=WATCHED)
    given = parser.parse_args()
    names = [name for name in given.targets if name != PROPERTIES]
    share = 0.5 if names and PROPERTIES in given.targets else 1.0
    FOUND.mkdir(parents=True, exist_ok=True)
    clean = True
    if names:
        clean = readers_are_clean(names, share * given.seconds, given.runs, given.seed, given.watch)
    if PROPERTIES in given.targets:
        clean = properties_hold(share * given.seconds) and clean
    sys.exit(0 if clean else 1)


def readers_are_clean(names: list[str], seconds: float, runs: int, seed: int, watch: Sequence[str]) -> bool:
    """Fuzz one reader after the other, each ``runs`` times or (-1) for its share of the time. True: nothing found."""
    if importlib.util.find_spec("atheris") is None:
        sys.exit("atheris is not installed; there are builds of it for Linux on x86-64 only: pip install -e '.[fuzz]'")
    known = watched_targets(watch)
    names = list(known) if names == ["all"] else names
    if unknown := sorted(set(names) - known.keys()):
        sys.exit(f"{unknown[0]}: no such target; there are {', '.join(known)}, {PROPERTIES}")
    limit = f"-runs={runs}" if runs >= 0 else f"-max_total_time={max(1, round(seconds / len(names)))}"
    limits = [limit, f"-seed={seed}"]
    results = [is_clean(name, known[name], limits) for name in names]
    return all(results)


if __name__ == "__main__":
    kernel_cache.use_cache(os.environ)
    main()
