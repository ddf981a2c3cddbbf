"""Every shipped mission: one drive, and what the report counts."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from sitl.experiments import missions
from sitl.experiments.dead_companion import shipped, with_suite
from sitl.experiments.experiment import ExperimentError, Options
from sitl.experiments.missions import NO_WAY, MissionDrive, MissionsReport, drive

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


CASES = ((0.3, 0.0), (0.5, 0.0), (0.3, 0.2))
"""How far the rover is off its model, and how long a message takes."""


@pytest.mark.thorough
def test_a_drive_says_who_led_it() -> None:
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "lidar-90")
    one = drive(mission, "motion-ga", 0, guarded=True)
    assert (one.mission, one.suite, one.controller) == (mission.name, "lidar-90", "motion-ga")
    assert (one.touched, one.run_into, one.refused, one.missed) == (0, 0, 0, 0) and 10.0 < one.seconds < 200.0


@pytest.mark.thorough
def test_single_beams_lead_the_same_way_with_a_guard_and_without() -> None:
    """Positions end by themselves. On arcs the rover goes slower without a guard."""
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "beams")
    guarded, strict = (drive(mission, "motion-ga", 5, guarded=guarded) for guarded in (True, False))
    assert guarded == strict and guarded.controller == "points"


@pytest.mark.thorough
def test_a_rover_further_off_and_a_late_link_are_driven_with_and_told() -> None:
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "lidar-360")
    usual, off, late = (drive(mission, "points", 0, guarded=False, off=o, late_s=s) for o, s in CASES)
    assert (usual.touched, off.touched, late.touched) == (0, 0, 0)
    assert len({usual.seconds, off.seconds, late.seconds}) == 3 and late.seconds > usual.seconds
    options = Options(2, off=0.5, late_s=0.2)
    report = MissionsReport(options, (off, late))
    assert (
        report.section_name == "missions-off-model" and MissionsReport(Options(2), (usual,)).section_name == "missions"
    )
    assert MissionsReport(Options(2, guard=True), (usual,)).section_name == "missions-guarded"
    assert "--off 0.5 --late 0.2" in report.section() and "each message takes 0.2 s" in report.section()


def test_the_mission_without_a_way_is_named_as_it_is() -> None:
    assert load_mission(MISSIONS / "sealed.toml").name in NO_WAY


def test_some_missions_can_be_chosen_by_their_files() -> None:
    chosen = shipped(Options(missions=("depot", "field.plan")))
    assert [mission.name for mission in chosen] == [
        load_mission(MISSIONS / file).name for file in ("field.plan", "depot.toml")
    ]
    assert "--missions depot,field.plan" in Options(missions=("depot", "field.plan")).command("missions")
    with pytest.raises(ExperimentError, match="--missions: 'hill' is unknown; known: open, one-obstacle"):
        shipped(Options(missions=("hill",)))


def test_some_suites_of_sensors_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    driven: list[tuple[object, ...]] = []

    def each(jobs: int, work: object, tasks: list[tuple[object, ...]], keep: object) -> list[MissionDrive]:
        driven.extend(tasks)
        return [MissionDrive("Rooms", str(task[0].sitl.sensors), "points", 0, 0, 0, 0, 0, 9.0) for task in tasks]  # type: ignore[attr-defined]

    monkeypatch.setattr(missions, "each", each)
    options = Options(1, missions=("rooms",), sensors=("beams", "lidar-90"))
    report = missions.run(options, lambda done, of: None)
    assert [one.suite for one in report.drives] == ["lidar-90", "beams"] and len(driven) == 2
    assert "`beams`:" in report.section() and "`lidar-360`:" not in report.section() and len(report.tables()) == 2
    assert "--missions rooms --sensors beams,lidar-90" in report.section() and "\n`rooms` with each" in report.section()
    assert report.section_name == "missions-rooms-beams-lidar-90", "a part does not take the place of the whole"
    with pytest.raises(ExperimentError, match="--sensors: 'beam' is unknown, did you mean 'beams'"):
        missions.run(Options(1, sensors=("beam",)), lambda done, of: None)


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
    assert report._rows("beams") == [] and "## Every shipped mission\n" in report.section()


def test_later_seeds_have_a_section_of_their_own() -> None:
    later = MissionsReport(Options(runs=25, seed=25, guard=True), ())
    assert later.section_name == "missions-guarded-from-25"
    assert "## Every shipped mission, with the guard on the autopilot, seeds 25 to 49\n" in later.section()
