"""One run of a campaign: an error is a result, and where the time went is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.executive.mission_progress import TargetStatus
from sitl.campaign import drive_run
from sitl.campaign.drive_run import check_spec, drive, prepared
from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import RunSpec
from sitl.experiments.time_bound import ways_m
from sitl.generators.made_ground import made
from sitl.generators.measures import Difficulty
from sitl.lockstep import Drive, TrackPoint
from sitl.scenario import ScenarioError

SPEC = RunSpec("maze", "hybrid", "points", "own", "none", False, 0.0, 0.0, "shipped", 1, 100.0, False, "{}")


def test_an_error_of_the_programs_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(spec: RunSpec, folder: Path) -> None:
        raise ValueError("no\nsuch thing")

    monkeypatch.setattr(drive_run, "prepared", fails)
    result = drive(SPEC, Path())
    assert (result.outcome, result.said) == ("error", "ValueError: no such thing") and result.cpu_s >= 0.0
    assert broken(result) == (Policy.NO_ERROR,) and not result.complete


def test_an_error_on_the_way_leaves_all_targets_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(run: Drive) -> None:
        raise ValueError("on the way")

    monkeypatch.setattr(drive_run, "WireWatch", fails)
    result = drive(SPEC, Path())
    assert (result.outcome, result.reached, result.targets) == ("error", 0, 1)


def test_an_interrupt_within_a_compiled_loop_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(spec: RunSpec, folder: Path) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr(drive_run, "prepared", interrupted)
    with pytest.raises(KeyboardInterrupt):
        drive(SPEC, Path())


def test_a_companion_that_starts_late_finds_a_ready_autopilot_and_older_runs_keep_their_names(
    tmp_path: Path,
) -> None:
    short = replace(SPEC, world="clutter target_east_m=6")
    assert SPEC.id == "f017a8929d80" and replace(SPEC, autopilot_on_s=40.0).id != SPEC.id
    run = prepared(replace(short, autopilot_on_s=40.0), tmp_path)
    assert run.clock.now_s() == pytest.approx(40.0)
    report = run.run()
    assert report.targets[0][1] is TargetStatus.REACHED and len(run.companion.outcome.tick_seconds) < 600


def test_where_the_time_went_counts_from_the_first_movement() -> None:
    places = [(0.0, 5.0, 5.0), (40.0, 5.0, 5.0), (41.0, 5.5, 5.2), (44.0, 5.6, 5.3), (44.5, 7.0, 5.0), (46.5, 7.2, 5.1)]
    track = [TrackPoint(time_s, north_m, east_m, "-") for time_s, north_m, east_m in places]
    assert drive_run._dwelt(track) == ((5, 5, 3.5), (7, 5, 2.0))


def test_a_run_tells_how_difficult_its_ground_was_and_works_it_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    worked_out: list[Difficulty] = []
    monkeypatch.setattr("sitl.generators.made_ground.measured", lambda *given: worked_out.append(one) or one)
    one = Difficulty(1.0, 4.0, 3.5, 2.5, 1.2)
    spec = replace(SPEC, world="forest per_100_m2=1.5", seed=7, time_limit_s=1.0)
    results = [drive(spec, Path()), drive(replace(spec, planner="astar"), Path())]
    assert [result.ground for result in results] == [one, one] and len(worked_out) == 1
    assert drive(replace(spec, world="missing.toml"), Path()).ground is None


def test_the_ground_of_a_run_is_that_of_its_seed() -> None:
    result = drive(replace(SPEC, time_limit_s=1.0), Path())
    assert result.ground == made("maze", 1).difficulty and result.outcome == "time limit"


def test_the_bound_of_a_run_is_that_of_its_own_ground(tmp_path: Path) -> None:
    """Of each seed another one, with the same mission across; a mission's own is the same whatever the seed."""
    (tmp_path / "far.toml").write_text("[[target]]\nnorth_m = 0.0\neast_m = 30.0\n")
    spec = replace(SPEC, time_limit_s=46.0)  # the autopilot's start-up takes 43 s
    cruise_m_s = drive_run.mission_of(spec, Path()).rover.cruise_speed_m_s
    for seed in (1, 2):
        ground, (_, scenario) = made("maze", seed), drive_run._mission_and_scenario(replace(spec, seed=seed), Path())
        (way_m,) = ways_m(scenario, [ground.start_m, ground.goal_m]) or [0.0]
        assert way_m > 38.0
        assert drive(replace(spec, seed=seed), Path()).bound_s == pytest.approx(way_m / cruise_m_s, abs=0.3)
    bounds_s = [drive(replace(spec, world="far.toml", seed=seed), tmp_path).bound_s for seed in (1, 2)]
    assert bounds_s == pytest.approx([30.0 / cruise_m_s] * 2, abs=0.05)


def test_a_person_sets_guided_again_where_the_companion_waits_for_that(tmp_path: Path) -> None:
    (tmp_path / "near.toml").write_text("[[target]]\nnorth_m = 6.0\neast_m = 0.0\n[sitl]\nsensors = 'lidar-90'\n")
    lost = "link_outage start_s=0.5 duration_s=1 since=driving"
    spec = replace(SPEC, world="near.toml", faults=lost, guard=True, time_limit_s=80.0)
    alone, helped = drive(spec, tmp_path), drive(replace(spec, person=True), tmp_path)
    assert (alone.outcome, alone.helped) == ("time limit", 0) and alone.waits_for.startswith("a person to set GUIDED")
    assert (helped.outcome, helped.helped, helped.waits_for, helped.against_pilot) == ("reached", 1, "", 0)


def test_settings_of_a_run_have_its_planner_its_controller_and_its_variant() -> None:
    spec = RunSpec("maze", "astar", "motion-ga", "own", "none", True, 0.0, 0.0, "wide", 1, 100.0, False,
                   '{"guidance": {"clearance_m": 0.4}}')  # fmt: skip
    settings = drive_run.settings_of(spec)
    assert settings.navigator.planner == "astar" and settings.guidance.controller == "motion-ga"
    assert settings.guidance.clearance_m == 0.4 and settings.link.range_rate_hz == 20.0


def test_a_mission_without_range_sensors_is_driven_with_those_of_the_campaign_alone(tmp_path: Path) -> None:
    mission = "[[target]]\nnorth_m = 1.0\neast_m = 2.0\n[sitl]\nsensors = 'none'\n"
    (tmp_path / "blind.toml").write_text(mission)
    check_spec(replace(SPEC, world="blind.toml", sensors="lidar-360"), tmp_path)
    with pytest.raises(ScenarioError) as caught:
        check_spec(replace(SPEC, world="blind.toml"), tmp_path)
    said = str(caught.value)
    assert said.startswith(f"{tmp_path / 'blind.toml'}: sitl.sensors: ") and "the campaign's list sensors" in said
