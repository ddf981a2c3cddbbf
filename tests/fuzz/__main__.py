"""Coverage-guided fuzzing with atheris: ``python -m tests.fuzz TARGET... --seconds N`` (TARGET ``all``: every one in turn).

A find stops the target, prints its traceback and leaves its bytes in the directory ``out/fuzz``; once mended it goes into ``finds.py``,
and every test run reads it again. ``--runs N`` stops after as many tries; ``--seed N`` tries the same ones again.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.util
import io
import os
import re
import sys
import tempfile
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.fuzz.targets import Target

ROOT = Path(__file__).resolve().parents[2]
FOUND = Path("out/fuzz")
WATCHED = ("companion", "tomllib", "yaml", "json", "pymavlink")
"""Packages that are looked into: which of their branches are taken."""
SAID = ("stat::number_of_executed_units", "Done ")


def compiled_modules() -> list[str]:
    """The companion's modules that numba compiles: it would have to compile what atheris puts into them to watch their branches."""
    files = (ROOT / "companion").rglob("*.py")
    found = [path for path in files if re.search(r"^(from|import) numba\b", path.read_text(), re.MULTILINE)]
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in found)


def watched_targets() -> Mapping[str, Target]:
    """All targets, with the program watched."""
    import atheris

    quiet = contextlib.redirect_stderr(io.StringIO())  # a line for each module
    with quiet, atheris.instrument_imports(include=WATCHED, exclude=compiled_modules()):
        from tests.fuzz.targets import targets

        return targets()


def run(name: str, target: Target, corpus: Path, limits: list[str]) -> None:
    """Fuzz one target in this process, which ends with it."""
    import atheris

    for number, example in enumerate(target.examples):
        (corpus / f"{number}").write_bytes(example)
        target.read(example)  # compiles what has to be; later it would count as a hang
    always = ["-timeout=10", "-rss_limit_mb=2500", "-max_len=65536", "-print_final_stats=1"]

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


def main() -> None:
    """The command line; exit code 1 after a find."""
    parser = argparse.ArgumentParser(prog="tests.fuzz")
    parser.add_argument("targets", nargs="+")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--runs", type=int, default=-1)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        sys.exit("atheris is not installed; there are builds of it for Linux on x86-64 only: pip install -e '.[fuzz]'")
    known = watched_targets()
    names = list(known) if given.targets == ["all"] else given.targets
    if unknown := sorted(set(names) - known.keys()):
        sys.exit(f"{unknown[0]}: no such target; there are {', '.join(known)}")
    FOUND.mkdir(parents=True, exist_ok=True)
    limits = [f"-max_total_time={given.seconds}", f"-runs={given.runs}", f"-seed={given.seed}"]
    results = [is_clean(name, known[name], limits) for name in names]
    sys.exit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
