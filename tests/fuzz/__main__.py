"""Coverage-guided fuzzing with atheris: ``python -m tests.fuzz TARGET... --seconds N`` (TARGET ``all``: every one in turn).

Needs the extra ``fuzz`` (`pip install -e '.[fuzz]'`). A find stops the target, prints its traceback and leaves its bytes in the directory
``out/fuzz``; once mended it goes into ``finds.py``, and every test run reads it again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

FOUND = Path("out/fuzz")


def one(name: str, seconds: int) -> None:
    """Fuzz one target in this process, which ends with it."""
    import atheris

    with atheris.instrument_imports(include=["companion", "tomllib", "yaml", "json", "pymavlink"]):
        from tests.fuzz.targets import targets

        target = targets()[name]
    FOUND.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as corpus:
        for number, example in enumerate(target.examples):
            (Path(corpus) / f"{number}").write_bytes(example)
        limits = [f"-max_total_time={seconds}", "-timeout=10", "-rss_limit_mb=2500", "-max_len=65536"]
        atheris.Setup([name, *limits, f"-artifact_prefix={FOUND}/{name}-", "-print_final_stats=1", corpus], target.read)
        atheris.Fuzz()


def main() -> None:
    """The command line; exit code 1 after a find."""
    parser = argparse.ArgumentParser(prog="tests.fuzz")
    parser.add_argument("targets", nargs="+")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--here", action="store_true")
    given = parser.parse_args()
    if given.here:
        one(given.targets[0], given.seconds)
        return
    from tests.fuzz.targets import targets

    names = list(targets()) if given.targets == ["all"] else given.targets
    found = 0
    for name in names:
        command = [sys.executable, "-m", "tests.fuzz", name, "--here", "--seconds", str(given.seconds)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        lines = done.stderr.splitlines()
        runs = [line for line in lines if line.startswith(("stat::number_of_executed_units", "Done "))]
        print(f"{name}: {'nothing found' if done.returncode == 0 else 'FOUND'} {' '.join(runs)}", flush=True)
        if done.returncode:
            found += 1
            print("\n".join(line for line in (done.stdout + done.stderr).splitlines()[-60:]), flush=True)
    raise SystemExit(1 if found else 0)


if __name__ == "__main__":
    main()
