"""The BARN benchmark: narrow ground that nobody has mapped, the challenge's rover, protocol and score.

Perille, Truong, Xiao & Stone 2020, and the rules of the challenge at ICRA: 10 m ahead, reached within 1 m, 100 s from
the moment when the rover has moved 0.1 m, any contact ends a run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from companion.core.footprint import Footprint
from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.experiments.barn_worlds import GOAL_M, START_M, BarnWorld
from sitl.lockstep import Drive
from sitl.plant.outline import Outline
from sitl.scenario import SOMEWHERE, Scenario, outline_of
from sitl.sensors.range_sensors import Lidar, SensorSuite
from sitl.world.truth import SimStart

NAME = "barn"
JACKAL = Footprint.rectangle(0.508, 0.430)
SPEED_M_S = 2.0
LIMIT_S = 100.0
REACHED_M = 1.0
MOVED_M = 0.1
FASTEST, SLOWEST = 2.0, 8.0
"""The score counts a time between so many optimal times (since 2026; before, from 4 on)."""
OLD_FASTEST = 4.0
LIDAR = Lidar(3.75, -135.0 + 0.5 * 3.75, 0.06, 10.0, 20.0, 1, 72)
"""270 degrees, 10 m, as the challenge's; 72 rays instead of 720, because a MAVLink message has no room for more."""
WARM_S = 60.0
"""So long the rover may take until it moves."""


class RunEnd(StrEnum):
    """How a run ends."""

    REACHED = "reached"
    CONTACT = "contact"
    TIMEOUT = "timeout"


@dataclass(frozen=True, slots=True)
class BarnRun:
    """One run. ``seconds``: from the moment when the rover has moved; ``optimal_s``: of its world."""

    world: int
    seed: int
    end: RunEnd
    seconds: float
    optimal_s: float

    def score(self, fastest: float = FASTEST) -> float:
        """The challenge's score, at most 1 / ``fastest``."""
        return score(self.end is RunEnd.REACHED, self.seconds, self.optimal_s, fastest)


def score(reached: bool, seconds: float, optimal_s: float, fastest: float) -> float:
    """Of one run, as the challenge counts it."""
    return reached * optimal_s / min(max(seconds, fastest * optimal_s), SLOWEST * optimal_s)


def mission_of(world: BarnWorld) -> Mission:
    """10 m ahead."""
    goal = HomePoint(GOAL_M[1] - START_M[1], GOAL_M[0] - START_M[0])
    return Mission(
        f"world {world.number}", (Target("goal", goal, 0.0, OnBlocked.SKIP),), GridSpec(0.2, margin_m=2.6),
        RoverSpec(JACKAL.radius_m, SPEED_M_S, 0.0, JACKAL), sitl=SitlSpec(heading_deg=0.0),
    )  # fmt: skip


def drive(world: BarnWorld, seed: int, settings: Settings) -> BarnRun:
    """One run."""
    start = SimStart(START_M[1], START_M[0], 0.0, SOMEWHERE)
    mission = mission_of(world)
    outline: Outline = outline_of(mission.rover)
    parameters = {"WP_SPEED": SPEED_M_S, **RECOMMENDED_PARAMETERS}
    scenario = Scenario(world.world(), start, SensorSuite(LIDAR), outline, parameters)
    run = Drive(mission, scenario, settings, seed, NullRecorder(), WARM_S + LIMIT_S)
    simulator, began_s = run.simulator, math.inf
    while True:
        run.companion.tick()
        truth, now_s = simulator.truth, simulator.time_s
        moved_m = math.hypot(truth.north_m - start.north_m, truth.east_m - start.east_m)
        if math.isinf(began_s) and moved_m >= MOVED_M:
            began_s = now_s
        seconds = now_s - began_s if math.isfinite(began_s) else 0.0
        left_m = math.hypot(truth.east_m - GOAL_M[0], truth.north_m - GOAL_M[1])
        if simulator.collisions:
            end = RunEnd.CONTACT
        elif left_m <= REACHED_M:
            end = RunEnd.REACHED
        elif seconds >= LIMIT_S or run.companion.done or now_s > WARM_S + LIMIT_S:
            end = RunEnd.TIMEOUT
        else:
            continue
        return BarnRun(world.number, seed, end, seconds, world.optimal_s)
