"""Every shipped mission: one drive, and what the report counts."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from sitl.experiments.dead_companion import with_suite
from sitl.experiments.experiment import Options
from sitl.experiments.missions import NO_WAY, MissionDrive, MissionsReport, drive

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


@pytest.mark.thorough
def test_a_drive_says_who_led_it() -> None:
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "lidar-90")
    one = drive(mission, "motion-ga", 0, guarded=True)
    assert (one.mission, one.suite, one.controller) == (mission.name, "lidar-90", "motion-ga")
    assert (one.touched, one.run_into, one.refused, one.missed) == (0, 0, 0, 0) and 10.0 < one.seconds < 200.0


def test_the_mission_without_a_way_is_named_as_it_is() -> None:
    assert load_mission(MISSIONS / "sealed.toml").name in NO_WAY


def test_the_table_counts_each_mission_and_all() -> None:
    drives = (
        MissionDrive("Rooms", "lidar-360", "motion-ga", 0, 0, 0, 0, 0, 100.0),
        MissionDrive("Rooms", "lidar-360", "motion-ga", 1, 1, 2, 3, 1, 140.0),
        MissionDrive("Rooms", "lidar-90", "motion-ga", 0, 0, 0, 0, 0, 60.0),
    )
    report = MissionsReport(Options(runs=2), drives)
    rooms, total = report._rows("lidar-360")
    assert rooms[:8] == ["Rooms", "motion-ga", "2", "1", "2", "3", "1", "120.0"] and rooms[8] == "100 to 140"
    assert total[0] == "all" and total[2:7] == ["2", "1", "2", "3", "1"]
    assert report._rows("beams") == [] and "Every shipped mission" in report.section()
