"""A mission among moving obstacles, driven by the whole system over MAVLink bytes."""

from dataclasses import replace
from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import parse_settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSION = Path(__file__).resolve().parents[2] / "missions" / "crossing.toml"


def driven(planner: str, suite: str, seed: int) -> Drive:
    mission = load_mission(MISSION)
    assert mission.sitl is not None and len(mission.sitl.movers) == 6
    mission = replace(mission, sitl=replace(mission.sitl, sensors=suite))
    settings = parse_settings({"navigator": {"planner": planner}}, "test")
    run = Drive(mission, scenario_from_mission(mission), settings, seed, NullRecorder(), time_limit_s=600.0)
    run.run()
    return run


@pytest.mark.parametrize("suite", ["lidar-90", "lidar-360"])
@pytest.mark.parametrize("planner", ["hybrid", "vertex++"])
def test_crossing_is_driven_without_a_collision(planner: str, suite: str) -> None:
    run = driven(planner, suite, 0)
    assert run.simulator.collisions == ()
    assert run.report.exit_code == 0


def test_hardly_any_run_touches_what_moves() -> None:
    """Nothing there gives way, and one of the six announces nothing: a touch in twenty runs is known."""
    runs = [driven("hybrid", "lidar-90", seed) for seed in range(1, 7)]
    assert sum(len(run.simulator.collisions) for run in runs) <= 1
    assert all(status == "reached" for run in runs for _, status in run.report.targets)


def test_the_same_seed_meets_the_same_traffic() -> None:
    one, two = driven("vertex++", "lidar-90", 4), driven("vertex++", "lidar-90", 4)
    assert [(p.north_m, p.east_m) for p in one.report.track] == [(p.north_m, p.east_m) for p in two.report.track]
