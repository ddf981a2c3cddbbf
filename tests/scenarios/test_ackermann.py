"""A rover with steered wheels, in lock-step, through a world with a bay that is too narrow for a circle."""

from dataclasses import replace
from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.vehicle.commands import GuidedHeading
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSION = Path(__file__).resolve().parents[2] / "missions" / "ackermann.toml"


def run_of(suite: str, seed: int) -> Drive:
    mission = load_mission(MISSION)
    assert mission.sitl is not None and mission.rover.turning_radius_m == 2.5
    mission = replace(mission, sitl=replace(mission.sitl, sensors=suite))
    scenario = scenario_from_mission(mission)
    assert scenario.turning_radius_m == 2.5
    return Drive(mission, scenario, Settings(), seed, NullRecorder(), time_limit_s=900.0)


@pytest.mark.parametrize(
    ("suite", "seed"),
    [
        pytest.param("lidar-360", 0, marks=pytest.mark.thorough),
        pytest.param("lidar-360", 2, marks=pytest.mark.thorough),
        pytest.param("lidar-90", 0, marks=pytest.mark.thorough),
        pytest.param("lidar-90", 1, marks=pytest.mark.thorough),
    ],
)
def test_both_targets_are_reached_on_arcs_and_nothing_is_touched(suite: str, seed: int) -> None:
    """It is never told to turn on the spot; it backs up where it has to."""
    run = run_of(suite, seed)
    told, send = [], run.companion._autopilot.send
    speeds = []

    def heard(command, now_s):  # type: ignore[no-untyped-def]
        told.append(command)
        return send(command, now_s)

    run.companion._autopilot.send = heard  # type: ignore[method-assign]
    report = run.run(lambda status: speeds.append(run.simulator.truth.speed_m_s))
    assert run.simulator.collisions == ()
    assert [status for _, status in report.targets] == ["reached", "reached"]
    assert report.exit_code == 0
    assert len(told) > 500 and not any(isinstance(command, GuidedHeading) for command in told)
    assert max(speeds) > 1.5
    if (suite, seed) == ("lidar-360", 2):
        assert min(speeds) < -0.2
