"""Drives round walls' ends and through doors seen from the side, by rovers that their autopilot is tuned for or not.

In the real firmware's contact a rover that turned 2.4 times as much as its autopilot was tuned for swung into a wall's
end. Here two rovers drive such ground: that one, and the firmware's own.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.lockstep import Drive
from sitl.plant.outline import Outline
from sitl.plant.rover import SIM_ROVER, Drivetrain, two_wheels
from sitl.scenario import SOMEWHERE, Scenario
from sitl.world.truth import SimStart
from sitl.world.world import World

EAGER = two_wheels(3.46, 0.25, 0.6)
FINE_M = 0.25
WIDTH_M, HEIGHT_M = 50.0, 36.0
PARAMETERS = {"WP_SPEED": 2.0, **RECOMMENDED_PARAMETERS}
FOUND = 94
"""With WP_JERK 0, less room for overshoot and no rule for swinging rovers, the eager one touched a wall's end here."""


def fill(solid: np.ndarray[Any, Any], south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    rows, columns = (
        (round(at / FINE_M), round((at + size) / FINE_M)) for at, size in ((south_m, height_m), (west_m, width_m))
    )
    solid[slice(*rows), slice(*columns)] = True


def ground(rng: np.random.Generator) -> World:
    """Walls across the way, from either side, whose ends are passed; or from side to side with a door in each."""
    solid = np.zeros((int(HEIGHT_M / FINE_M), int(WIDTH_M / FINE_M)), dtype=np.bool_)
    ends, from_south, east_m = rng.random() < 0.5, bool(rng.integers(2)), 8.0
    while east_m < WIDTH_M - 8.0:
        if ends:
            length_m = rng.uniform(12.0, 26.0)
            south_m, height_m = (0.0, length_m) if from_south else (length_m, HEIGHT_M - length_m)
            fill(solid, south_m, east_m, height_m, 0.5)
            from_south = from_south ^ bool(rng.random() < 0.7)
        else:
            door_m, wide_m = rng.uniform(3.0, HEIGHT_M - 6.0), rng.uniform(2.25, 3.5)
            fill(solid, 0.0, east_m, door_m, 0.5)
            fill(solid, door_m + wide_m, east_m, HEIGHT_M, 0.5)
        east_m += rng.uniform(4.5, 10.0)
    solid[[0, -1], :] = True
    solid[:, [0, -1]] = True
    return World(solid, FINE_M)


def drive(seed: int, drivetrain: Drivetrain, jerk_m_s3: float = PARAMETERS["WP_JERK"]) -> Drive:
    """From one side to the other; the drive is over."""
    rng = np.random.default_rng([seed, 13])
    world = ground(rng)
    start_m, goal_m = (
        (rng.uniform(4.0, HEIGHT_M - 4.0), rng.uniform(3.0, 5.0)),
        (rng.uniform(4.0, HEIGHT_M - 4.0), 46.5),
    )
    suite, heading_deg = ("lidar-90", "lidar-360")[int(rng.integers(2))], float(rng.uniform(-180.0, 180.0))
    place = HomePoint(goal_m[0] - start_m[0], goal_m[1] - start_m[1])
    target = Target("far", place, 0.0, OnBlocked.SKIP)
    mission = Mission(
        f"corners {seed}", (target,), GridSpec(1.0), RoverSpec(0.4, 2.0, 0.0),
        sitl=SitlSpec(heading_deg=heading_deg, sensors=suite),
    )  # fmt: skip
    start = SimStart(*start_m, math.radians(heading_deg), SOMEWHERE)
    scenario = Scenario(world, start, suite, Outline(0.4), PARAMETERS | {"WP_JERK": jerk_m_s3}, drivetrain=drivetrain)
    run = Drive(mission, scenario, Settings(), seed, NullRecorder(), 900.0)
    run.run()
    return run


def assert_reached(run: Drive) -> None:
    assert run.simulator.collisions == ()
    assert run.companion.outcome.complete


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "jerk_m_s3"), [pytest.param(0, 3.0, marks=pytest.mark.thorough), (FOUND, 0.0)])
def test_an_eager_rover_comes_round_corners_without_a_contact(seed: int, jerk_m_s3: float) -> None:
    assert_reached(drive(seed, EAGER, jerk_m_s3))


@pytest.mark.thorough
@pytest.mark.parametrize("drivetrain", [EAGER, SIM_ROVER], ids=["eager", "tuned"])
@pytest.mark.parametrize("first", range(0, 200, 20))
def test_two_hundred_grounds_without_a_contact(first: int, drivetrain: Drivetrain) -> None:
    for seed in range(first, first + 20):
        assert_reached(drive(seed, drivetrain))
