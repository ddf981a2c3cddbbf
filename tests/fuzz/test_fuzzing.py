"""Every target of ``make fuzz`` gets under way: whoever finds nothing has looked."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.targets import targets

ROOT = Path(__file__).resolve().parents[2]
RUNS = 2

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("atheris") is None, reason="no build of atheris for this machine"
)


@pytest.mark.thorough
def test_every_target_is_fuzzed_without_a_find() -> None:
    command = [sys.executable, "-m", "tests.fuzz", "all", "--runs", str(RUNS), "--seed", "1", "--watch", "companion"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=500)
    executed = {
        name: int(number)
        for name, number in re.findall(r"^(\S+): nothing found .*number_of_executed_units: (\d+)", done.stdout, re.M)
    }
    assert executed.keys() == targets().keys(), done.stdout[-4000:] + done.stderr[-1000:]
    assert min(executed.values()) >= RUNS
    assert done.returncode == 0
