"""The same seed gives the same bytes: in one process, in two, whatever order Python's sets happen to have.

There is no stored hash: additions and products are the same everywhere, but sine, exponential and their like come from the machine's C
library, whose last digit depends on library and processor.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def started(mission: str, hash_seed: str, *seeds: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.conformance.hashed_run", mission, *seeds]
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)


EVERYTHING = "+".join(
    (
        "missions/depot.toml",
        "missions/sensors/weathered.toml",
        *(f"missions/faults/{plan}.toml" for plan in ("radio", "gps", "vehicle")),
    )
)
"""Doors, ice, a mover; sensors with every flaw; every kind of fault but those that end the drive."""


AUTO = "auto:missions/depot.toml+missions/sensors/weathered.toml+missions/faults/gps.toml"


@pytest.mark.parametrize(
    "mission", ["missions/crossing.toml", EVERYTHING, AUTO], ids=["crossing", "everything", "auto"]
)
def test_the_same_seed_gives_the_same_bytes(mission: str) -> None:
    runs = [started(mission, "1", "5", "6", "5"), started(mission, "2", "5")]
    first, second = (run.communicate(timeout=300)[0].split("\n")[:-1] for run in runs)
    assert [run.returncode for run in runs] == [0, 0]
    assert len(first) == 3
    assert first[0] == first[2] == second[0], "the same seed, three times, in two processes"
    assert first[0] != first[1], "another seed"
    _, packets, driven_m = first[0].split()
    assert int(packets) > 2000
    assert float(driven_m) > 10.0
