"""``make`` keeps an environment that works: another interpreter's files in it had left a mixture without ssl."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.docs.test_docs import ROOT

MAKE = shutil.which("make")
WORKS, BROKEN = "exit 0", 'case "$*" in *ssl*) exit 1;; esac'
"""What an environment's Python does; ssl is what a mixture of two interpreters lacks."""


def python(file: Path, does: str) -> None:
    """A stand-in that writes down its arguments."""
    file.parent.mkdir(parents=True)
    file.write_text(f'#!/bin/sh\necho "$*" >> "$CALLS"\n{does}\n', encoding="utf-8")
    file.chmod(0o755)


@pytest.mark.skipif(MAKE is None, reason="needs make")
@pytest.mark.parametrize("does", [WORKS, BROKEN])
def test_only_an_environment_that_does_not_work_is_made_anew(tmp_path: Path, does: str) -> None:
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / "companion").mkdir()
    (tmp_path / "sitl").mkdir()
    python(tmp_path / ".venv" / "bin" / "python", does)
    python(tmp_path / "other" / "python", WORKS)
    calls = tmp_path / "calls"
    subprocess.run(
        [str(MAKE), ".venv/.program", f"PYTHON={tmp_path / 'other' / 'python'}"],
        cwd=tmp_path, env={"PATH": os.environ["PATH"], "CALLS": str(calls)}, check=True, capture_output=True,
    )  # fmt: skip
    made = [line for line in calls.read_text(encoding="utf-8").splitlines() if line.startswith("-m venv")]
    assert made == ([] if does == WORKS else ["-m venv --clear .venv"])
