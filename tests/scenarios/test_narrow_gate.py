"""A yard with a gate of 1.0 m, a rover of 0.7 m, and a mission that says nothing but where to go."""

from __future__ import annotations

import math

import pytest

from companion.mission.mission import HomePoint, Mission, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.experiments.gates import SENSORS, SIDE_M, world_of
from sitl.lockstep import Drive, DriveOutcome
from sitl.scenario import SOMEWHERE, Scenario, outline_of
from sitl.world.truth import SimStart


@pytest.mark.parametrize(
    ("angle_deg", "aside_m", "seed"),
    [(0.0, 1.0, 0), *(pytest.param(*one, marks=pytest.mark.thorough) for one in ((30.0, -1.2, 1), (30.0, 0.5, 2)))],
)
def test_a_rover_with_default_settings_gets_through(angle_deg: float, aside_m: float, seed: int) -> None:
    goal = Target("goal", HomePoint(0.0, SIDE_M - 6.0))
    mission = Mission("gate", (goal,), sitl=SitlSpec(heading_deg=90.0, sensors=SENSORS))
    start = SimStart(0.5 * SIDE_M, 3.0, math.radians(90.0), SOMEWHERE)
    scenario = Scenario(world_of(1.0, angle_deg, aside_m), start, SENSORS, outline_of(mission.rover))
    run = Drive(mission, scenario, Settings(), seed, NullRecorder(), 240.0)
    report = run.run()
    assert report.outcome is DriveOutcome.REACHED and report.collisions == 0 and run.companion.outcome.complete
    assert report.refused == 0
