"""A companion that is killed again and again and resumes its run, as an experiment; small."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.mission.load import load_mission
from sitl.experiments.dead_companion import SUITES, with_suite
from sitl.experiments.experiment import Options
from sitl.experiments.killed_companion import Contact, KilledDrive, KilledReport, Motors, deaths_of, with_motors

MISSIONS = Path(__file__).resolve().parents[2] / "missions"


@pytest.fixture(scope="module")
def drives() -> list[KilledDrive]:
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "lidar-360")
    return deaths_of(with_motors(mission, Motors.EAGER), Motors.EAGER, 3, 5)


@pytest.mark.thorough
def test_it_dies_often_enough_and_each_mission_ends_without_a_contact(drives: list[KilledDrive]) -> None:
    deaths = [len(drive.deaths) for drive in drives]
    assert sum(deaths) >= 5 > sum(deaths[:-1]) and min(deaths) > 0
    assert all(drive.ended and drive.contacts == [] and drive.person == 0 for drive in drives)
    assert len({tuple(drive.deaths) for drive in drives}) == len(drives), "other moments with another seed"


def test_a_contact_is_a_failure_and_being_run_into_is_not(drives: list[KilledDrive]) -> None:
    report = KilledReport(Options(runs=5), tuple(drives))
    assert report.failure == "" and f"{sum(len(drive.deaths) for drive in drives)} deaths" in report.section()
    assert {len(table.columns) for table in report.tables()} == {7} and len(report.tables()) == len(SUITES)
    stood = replace(drives[0], contacts=[Contact(80.0, 0.0, "cart", 1.0, 2.0, 3.0)])
    assert replace(report, drives=(stood,)).failure == "" and stood.run_into == 1
    guarded = KilledReport(Options(runs=5, guard=True), (replace(drives[0], controller="motion-ga"),))
    assert guarded.section_name != report.section_name and "--guard" in guarded.section()
    assert "eager, motion-ga" in guarded.section() and "motion-ga" not in report.section()
    moved = replace(drives[0], contacts=[Contact(80.0, 0.5, None, None, 4.25, -3.5)])
    touched = replace(report, drives=(moved,))
    assert touched.failure.startswith("1 contacts")
    assert "| 80.0 | 4.2 | -3.5 | 0.50 | what stands | - |" in touched.section()
