"""Ranges that are old when they come: the companion finds that out on the way, from real messages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sitl.campaign.drive_run import prepared
from sitl.campaign.run_spec import RunSpec


@pytest.mark.parametrize("age_s", [0.15, 0.0])
def test_the_age_of_a_lidars_ranges_is_found_while_the_rover_drives(age_s: float) -> None:
    sensors = f"own noise_m=0.02 dropout=0.05 latency_s={age_s:g}"
    spec = RunSpec("yard", "hybrid", "points", sensors, "none", False, 0.1, 0.0, "shipped", 3, 60.0, False, "{}")
    said = " ".join(prepared(spec, Path()).run().said)
    found = [float(one) for one in re.findall(r"Ranges \(obstacle distance\) are (\S+) s older than positions", said)]
    assert found == ([] if age_s == 0.0 else [pytest.approx(age_s, abs=0.04)])
