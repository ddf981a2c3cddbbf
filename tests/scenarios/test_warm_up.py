"""After the warm-up no kernel is compiled: a compiler in the middle of a drive would stall it for seconds."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

CASES = [
    ("drive", "crossing.toml", "vertex++", "points", "64"),
    ("drive", "ackermann.toml", "hybrid", "motion-ga", "66"),  # led by points
    ("drive", "one-obstacle.toml", "hybrid", "motion-ga", "62"),
    ("serve", "ackermann.toml", "lidar-360"),
]


@pytest.mark.thorough
def test_neither_a_drive_nor_a_vehicle_that_is_served_compiles_anything() -> None:
    """A client that starts the first mission would wait for a compiler, without heartbeats of the vehicle."""
    command = [sys.executable, "-m", "tests.scenarios.compiled_kernels", *map(",".join, CASES)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = [json.loads(line) for line in done.stdout.splitlines()]
    for (what, *case), one in zip(CASES, found, strict=True):
        assert one["kernels"] >= 5 and one["new"] == [], case
        if what == "drive":
            assert float(one["said"][0]) > 15.0, "seconds under way"
        else:
            assert any("Mission: 4" in text for text in one["said"]), "the circle was begun"


WARM = """
import sys
import pytest
from companion.settings import Settings
from companion.executive.warm_up import kernels_warm, warm_up
if sys.argv[1] == "warm":
    warm_up(Settings())
print(kernels_warm(Settings()))
"""


@pytest.mark.thorough
def test_it_is_known_whether_the_kernels_are_warm_and_asking_compiles_nothing(tmp_path: Path) -> None:
    for place, told in ((tmp_path / "new", "False"), (None, "True")):
        command = [sys.executable, "-c", WARM, "cold" if place else "warm"]
        environment = {**os.environ, **({"NUMBA_CACHE_DIR": str(place)} if place else {})}
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)
        assert (done.returncode, done.stdout.strip()) == (0, told), done.stderr
    assert not list(tmp_path.rglob("*.nbc"))
