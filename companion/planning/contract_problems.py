"""Random problems on which planners are held to their contract: any planner, and those that promise more.

Nouns: contract problem.
"""

from __future__ import annotations

import math

import numpy as np

from companion.core.grid import BASE_WEIGHT, Cell
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, KinematicConstraints, ObstacleTrajectory, PlanningProblem

MOST_SIDE = 14
CROSSING_SIDE = 16
TURNING_SIDE = 40
LARGE = (75, 30)
BUDGET = Budget(min_epochs=2, max_epochs=15, control_points=(4, 6), population=18)
"""Short, so that a genetic algorithm's budget is often spent."""
TURNING_BUDGET = Budget(min_epochs=2, max_epochs=200, control_points=(4, 6), population=30)
"""Enough for easy ground: there a promised turning radius must be kept, not only considered."""


def tasks_for(promised: Capabilities, seed: int) -> list[tuple[PlanningProblem, Budget]]:
    """The problems of a seed with their budgets: one for all planners, and one for each promise that needs its own."""
    tasks = [(random_problem(np.random.default_rng(seed)), BUDGET)]
    tasks += [(crossing_problem(np.random.default_rng(seed)), BUDGET)] if promised.moving_obstacles else []
    tasks += [(turning_problem(np.random.default_rng(seed)), TURNING_BUDGET)] if promised.turning_radius else []
    return tasks


def random_problem(rng: np.random.Generator) -> PlanningProblem:
    """A small one, mostly with a way and many corners: most faults show only where a path is found beside obstacles."""
    width, height = (int(side) for side in rng.integers(1, MOST_SIDE + 1, 2))
    ground = rng.integers(3)
    weights = rng.random((height, width)) if ground == 0 else np.full((height, width), 0.5 * (ground - 1))
    weights[rng.random((height, width)) < rng.choice([0.25, 0.1, 0.4, 0.0])] = 1.0
    if rng.random() < 0.2:  # ends anywhere: on obstacles, outside the map
        start, target = (Cell(int(rng.integers(-1, width + 1)), int(rng.integers(-1, height + 1))) for _ in range(2))
    else:  # free and usually far apart
        low, high = sorted(rng.integers(0, width, 2))
        start, target = Cell(int(low), int(rng.integers(height))), Cell(int(high), int(rng.integers(height)))
        weights[start.y, start.x] = weights[target.y, target.x] = 0.5
    weights.flags.writeable = bool(rng.random() < 0.5)
    return PlanningProblem(weights, start, target, bool(rng.random() < 0.5))


def large_problem(rng: np.random.Generator) -> PlanningProblem:
    """As large as the map of a yard: from one corner to the other past walls with gaps, so that there is a way."""
    width, height = LARGE
    weights = np.full((height, width), BASE_WEIGHT)
    for x in range(12, width - 10, 12):
        weights[:, x] = 1.0
        gap = int(rng.integers(height - 4))
        weights[gap : gap + 4, x] = BASE_WEIGHT
    return PlanningProblem(weights, Cell(0, 0), Cell(width - 1, height - 1))


def crossing_problem(rng: np.random.Generator) -> PlanningProblem:
    """A disc crosses the straight line from start to target just when a rover at full speed is there; few obstacles."""
    side, middle = CROSSING_SIDE, 0.5 * (CROSSING_SIDE - 1)
    weights = np.full((side, side), BASE_WEIGHT)
    weights[rng.random((side, side)) < 0.05] = 1.0
    start, target = Cell(0, int(rng.integers(side))), Cell(side - 1, int(rng.integers(side)))
    weights[start.y, start.x] = weights[target.y, target.x] = BASE_WEIGHT
    kinematics = KinematicConstraints()
    met_s = 0.5 * math.hypot(target.x - start.x, target.y - start.y) / kinematics.speeds_fields_s[1]
    met = np.array((middle, 0.5 * (start.y + target.y)))
    heading_rad = rng.choice((-1.0, 1.0)) * rng.uniform(0.25, 0.75) * math.pi
    along = rng.uniform(0.5, 1.5) * met_s * np.array((math.cos(heading_rad), math.sin(heading_rad)))
    track = np.array([(0.0, *(met - along)), (2.0 * met_s, *(met + along))])
    return PlanningProblem(weights, start, target, False, (ObstacleTrajectory(1.5, track),), kinematics)


def turning_problem(rng: np.random.Generator) -> PlanningProblem:
    """Open ground with room to turn; the rover heads 30 to 75 degrees off the target."""
    middle, reach = 0.5 * TURNING_SIDE, 0.35 * TURNING_SIDE
    bearing_rad = rng.uniform(-math.pi, math.pi)
    along_x, along_y = reach * math.cos(bearing_rad), reach * math.sin(bearing_rad)
    start = Cell(round(middle - along_x), round(middle - along_y))
    target = Cell(round(middle + along_x), round(middle + along_y))
    off_rad = rng.choice((-1.0, 1.0)) * math.radians(rng.uniform(30.0, 75.0))
    heading_rad = math.remainder(bearing_rad + off_rad, 2.0 * math.pi)
    kinematics = KinematicConstraints(heading_rad, float(rng.uniform(2.0, 4.0)))
    return PlanningProblem(np.full((TURNING_SIDE, TURNING_SIDE), BASE_WEIGHT), start, target, kinematics=kinematics)
