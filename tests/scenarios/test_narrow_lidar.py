"""A lidar that looks 60 or 90 degrees wide may never see the end of a wall: planned motions keep clear of it."""

from __future__ import annotations

import pytest

from companion.mission.load import load_mission
from sitl.experiments.missions import drive
from sitl.scenario import with_sensors
from tests.support.records import MISSIONS


@pytest.mark.thorough
@pytest.mark.parametrize(("sensors", "seed"), [("lidar-90", 45), ("narrow-lidar", 45), ("narrow-lidar", 56)])
def test_a_turn_round_the_end_of_a_wall_that_was_never_seen_touches_nothing(sensors: str, seed: int) -> None:
    """Each of these drives touched a corner, whose ground counted as seen because it lay beside the rover."""
    named = sensors if sensors == "lidar-90" else str(MISSIONS / "sensors" / f"{sensors}.toml")
    drove = drive(with_sensors(load_mission(MISSIONS / "rooms.toml"), named), "motion-ga", seed, guarded=True)
    assert (drove.touched, drove.refused, drove.missed) == (0, 0, 0)
