"""What every planner must keep (``Planner.plan``), checked on one problem; and random problems to check it on.

Nouns: planner contract.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import Cell
from companion.planning.planner import Planner
from companion.planning.problem import Budget, Path, PlanningProblem, PlanStatus, path_cost
from companion.planning.raster import FAULTS, PathFault, first_fault, plain

Curve = NDArray[np.float64]
MOST_SIDE = 14
NEAR_ENOUGH = 1e-6
"""Fields; of the ends of a smooth curve."""


def broken_by(planner: Planner, problem: PlanningProblem, budget: Budget, seed: int) -> str:
    """What a planner does wrong on a problem, in words; empty if it keeps the contract."""
    before = problem.weights.copy()
    result = planner.plan(problem, budget, np.random.default_rng(seed))
    again = planner.plan(problem, budget, np.random.default_rng(seed))
    if not np.array_equal(problem.weights, before):
        return "it changed the weights of the problem"
    if result.planner != planner.name:
        return f"its result says planner {result.planner!r}, it is {planner.name!r}"
    if (result.path is not None) != (result.status is PlanStatus.FOUND):
        return f"status {result.status} {'with' if result.path is not None else 'without'} a path"
    if result.status != again.status or result.epochs != again.epochs:
        return "the same seed gave another result"
    there_is_a_way = reachable(problem)
    if result.status is PlanStatus.NO_PATH and (there_is_a_way or not planner.capabilities.proves_no_path):
        return "it says NO_PATH, and " + ("there is one" if there_is_a_way else "its capabilities say it cannot know")
    if planner.capabilities.proves_no_path and result.status is PlanStatus.BUDGET_SPENT:
        return "it says BUDGET_SPENT, and its capabilities say that it always knows"
    if result.path is None:
        return ""
    if again.path is None or again.path.cells != result.path.cells or again.path.cost != result.path.cost:
        return "the same seed gave another path"
    if not _same_curve(result.path.curve, again.path.curve):
        return "the same seed gave another curve"
    return _fault_of(result.path, problem, planner)


def _same_curve(one: Curve | None, two: Curve | None) -> bool:
    return one is two if one is None or two is None else np.array_equal(one, two, equal_nan=True)


def _fault_of(path: Path, problem: PlanningProblem, planner: Planner) -> str:
    cells = path.cells
    if not cells or cells[0] != problem.start or cells[-1] != problem.target:
        return "its path does not lead from start to target"
    number, index = first_fault(plain(problem.weights), path.cell_array, problem.corner_cutting)
    if FAULTS[number] is not PathFault.NONE:
        return f"its path: {FAULTS[number]}, at field {index}"
    if len(set(cells)) < len(cells):
        return "its path comes twice to one field"
    cost = path_cost(problem.weights, cells)
    if not math.isclose(path.cost, cost, rel_tol=1e-9, abs_tol=1e-12):
        return f"its path costs {cost:.6g}, it says {path.cost:.6g}"
    if path.curve is None:
        return ""
    if not (planner.capabilities.smooth_curve or planner.capabilities.any_angle):
        return "it gives a curve, and its capabilities say neither smooth_curve nor any_angle"
    if path.curve.ndim != 2 or path.curve.shape[1] != 2 or not np.isfinite(path.curve).all():
        return "its curve is no array of finite places, shape (n, 2)"
    ends = np.array((problem.start, problem.target), dtype=np.float64)
    if np.abs(path.curve[[0, -1]] - ends).max() > NEAR_ENOUGH:
        return "its curve does not begin at the start and end at the target"
    return ""


def reachable(problem: PlanningProblem) -> bool:
    """By flood fill. Without corner cutting a diagonal step is never the only way, so four neighbours are enough."""
    if not problem.ends_are_free:
        return False
    free = plain(problem.weights) < 1.0
    height, width = free.shape
    steps = [(1, 0), (-1, 0), (0, 1), (0, -1)]
    steps += [(1, 1), (1, -1), (-1, 1), (-1, -1)] if problem.corner_cutting else []
    seen, edge = {tuple(problem.start)}, deque([tuple(problem.start)])
    while edge:
        x, y = edge.popleft()
        for dx, dy in steps:
            place = (x + dx, y + dy)
            if place not in seen and 0 <= place[0] < width and 0 <= place[1] < height and free[place[1], place[0]]:
                seen.add(place)
                edge.append(place)
    return tuple(problem.target) in seen


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
