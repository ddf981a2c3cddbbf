"""A yard with a gate of 1.0 m, a rover of 0.7 m, and a mission that says nothing but where to go."""

from __future__ import annotations

import math

import pytest

from companion.mission.field_size import finer_evidence, sure_gap_m
from companion.mission.mission import HomePoint, Mission, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import MappingSettings, Settings
from sitl.experiments.gates import SENSORS, SIDE_M, world_of
from sitl.experiments.off_model import parameters_for
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


@pytest.mark.thorough
@pytest.mark.parametrize(("angle_deg", "aside_m", "seed"), [(0.0, 1.0, 0), (30.0, -1.2, 1), (60.0, 0.37, 2)])
def test_one_that_turns_in_arcs_gets_through_a_gate_that_mission_check_promises(
    angle_deg: float, aside_m: float, seed: int
) -> None:
    goal, rover = Target("goal", HomePoint(0.0, SIDE_M - 6.0)), RoverSpec(turning_radius_m=1.0)
    mission = Mission("gate", (goal,), rover=rover, sitl=SitlSpec(heading_deg=90.0, sensors=SENSORS))
    assert sure_gap_m(rover, finer_evidence(MappingSettings(), 0.25), 0.25) == pytest.approx(1.2)
    start = SimStart(0.5 * SIDE_M, 3.0, math.radians(90.0), SOMEWHERE)
    parameters = parameters_for(rover, "points")
    world = world_of(1.2, angle_deg, aside_m)
    run = Drive(
        mission, Scenario(world, start, SENSORS, outline_of(rover), parameters), Settings(), seed, NullRecorder(), 240.0
    )
    report = run.run()
    assert run.companion.evidence is not None and run.companion.evidence.base.resolution_m == 0.25
    assert report.outcome is DriveOutcome.REACHED and report.collisions == 0 and report.refused == 0
