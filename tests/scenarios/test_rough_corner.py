"""A closed house round the target, and rough ground over one of its corners: driven round, not touched, and told."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

WORLD = """
size_m = [40, 30]
[[obstacle]]
line_m = [[10, 18], [10, 26], [20, 26], [20, 18], [10, 18]]
width_m = 0.5
[[rough]]
polygon_m = [[17, 23], [17, 29], [23, 29], [23, 23]]
top_speed_m_s = 0.5
"""
MISSION = """
[[target]]
north_m = 0
east_m = 20
[sitl]
world = "world.toml"
start = [2, 15]
heading_deg = 90
sensors = "lidar-360"
"""


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_wall_is_touched_and_the_target_is_unreachable(tmp_path: Path, seed: int) -> None:
    """Before the rover was told to roll back, it rolled on into the wall: five touches in these three drives."""
    (tmp_path / "world.toml").write_text(WORLD)
    (tmp_path / "mission.toml").write_text(MISSION)
    mission = load_mission(tmp_path / "mission.toml")
    drive = Drive(mission, scenario_from_mission(mission), Settings(), seed, NullRecorder(), 600.0)
    report = drive.run()
    assert drive.simulator.collisions == ()
    assert [status for _, status in report.targets] == [TargetStatus.UNREACHABLE]
    assert report.driving_time_s < 300.0
