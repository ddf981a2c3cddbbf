"""What every planner must keep (``Planner.plan``) and what its own capabilities promise, checked on one problem.

Nouns: planner contract.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.planning.graph_search.dijkstra import Dijkstra
from companion.planning.line_to_drive import AHEAD_DEG, bearing_of, line_of, too_tight
from companion.planning.planner import Capabilities, Planner
from companion.planning.problem import Budget, Path, PlanningProblem, PlanStatus, path_cost
from companion.planning.raster import FAULTS, PathFault, first_fault, plain, polyline
from companion.settings import PlannerSettings

Curve = NDArray[np.float64]
NEAR_ENOUGH = 1e-6
"""Fields, of the ends of a curve; fields/s, of a speed."""
MOST_ASIDE_FIELDS = 2.0
"""A smooth curve may leave its path by so much, on problems as small as those of ``contract_problems``. The curve of
Kwasniewski & Gosiewski passes beside the straight lines whose fields are checked, and may graze an obstacle there."""
STEP_FIELDS = 0.1
STEP_S = 0.02
SLACK_FIELDS = 0.05
"""A meeting that is no deeper is one of rounding."""


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
    promised = planner.capabilities
    wrong = _fault_of_curve(path, problem, promised) or _fault_of_speeds(path, problem, promised)
    return wrong or _broken_promise(path, problem, promised)


def _fault_of_curve(path: Path, problem: PlanningProblem, promised: Capabilities) -> str:
    curve = path.curve
    if curve is None:
        return ""
    if not (promised.smooth_curve or promised.any_angle):
        return "it gives a curve, and its capabilities say neither smooth_curve nor any_angle"
    if curve.ndim != 2 or curve.shape[1] != 2 or not np.isfinite(curve).all():
        return "its curve is no array of finite places, shape (n, 2)"
    ends = np.array((problem.start, problem.target), dtype=np.float64)
    if len(curve) == 0 or np.abs(curve[[0, -1]] - ends).max() > NEAR_ENOUGH:
        return "its curve does not begin at the start and end at the target"
    if promised.smooth_curve:
        aside = np.abs(_walked(curve)[:, None] - path.cell_array).max(axis=2).min(axis=1)
        far = f"its curve leads {aside.max():.1f} fields away from its path, {MOST_ASIDE_FIELDS:g} is the most"
        return far if aside.max() > MOST_ASIDE_FIELDS else ""
    corners = np.floor(curve + 0.5).astype(np.int64)
    number, index = first_fault(plain(problem.weights), polyline(corners), problem.corner_cutting)
    fault = f"its curve is the line to drive, and has a fault: {FAULTS[number]}, at field {index} under it"
    return "" if FAULTS[number] is PathFault.NONE else fault


def _fault_of_speeds(path: Path, problem: PlanningProblem, promised: Capabilities) -> str:
    speeds, curve = path.speeds_fields_s, path.curve
    if speeds is None:
        return "it gives a curve without speeds, and promises speeds" if promised.speeds and curve is not None else ""
    if not promised.speeds:
        return "it gives speeds, and its capabilities do not say so"
    low, high = problem.kinematics.speeds_fields_s
    if curve is None or speeds.shape != (len(curve) - 1,):
        return "its speeds are not one from each point of its curve to the next"
    within = bool(((speeds >= low - NEAR_ENOUGH) & (speeds <= high + NEAR_ENOUGH)).all())
    return "" if within else f"it gives a speed outside {low:g} to {high:g} fields/s"


def _broken_promise(path: Path, problem: PlanningProblem, promised: Capabilities) -> str:
    kinematics = problem.kinematics
    if promised.optimal:
        cheapest = Dijkstra(PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
        if cheapest is not None and path.cost > cheapest.cost * (1.0 + 1e-9) + 1e-12:
            return f"it promises optimal, and its path costs {path.cost:.6g} where {cheapest.cost:.6g} is enough"
    if len(path.cell_array) < 2:
        return ""
    line, radius = line_of(path), kinematics.turning_radius_fields
    if promised.moving_obstacles and (met := _meeting(line, path.speeds_fields_s, problem)):
        return f"it promises moving_obstacles, and {met}"
    if promised.turning_radius and radius > 0.0:
        if tight := len(too_tight(line, radius)):
            bends = f"{tight} bend{'s' * (tight > 1)} tighter than the radius, {radius:.3g} fields"
            return f"it promises turning_radius, and its line has {bends}"
        off_rad = 0.0 if kinematics.heading_rad is None else bearing_of(line) - kinematics.heading_rad
        off_deg = math.degrees(abs(math.remainder(off_rad, 2.0 * math.pi)))
        if off_deg > AHEAD_DEG:
            return f"it promises turning_radius, and its line sets out {off_deg:.0f} deg off the heading"
    return ""


def _walked(line: Curve) -> Curve:
    """Places along a line, at most STEP_FIELDS apart."""
    steps = np.ceil(np.hypot(*np.diff(line, axis=0).T) / STEP_FIELDS).astype(np.int64)
    at = np.concatenate([[0.0], *(i + np.arange(1, count + 1) / count for i, count in enumerate(steps) if count)])
    return np.column_stack([np.interp(at, np.arange(len(line)), line[:, axis]) for axis in (0, 1)])


def _meeting(line: Curve, speeds_fields_s: NDArray[np.float64] | None, problem: PlanningProblem) -> str:
    """Where the rover first meets a moving obstacle, in words; empty if it meets none.

    Without speeds of the planner it drives as fast as it may.
    """
    lengths = np.hypot(*np.diff(line, axis=0).T)
    speeds = problem.kinematics.speeds_fields_s[1] if speeds_fields_s is None else speeds_fields_s
    passed_s = np.concatenate(([0.0], np.cumsum(lengths / speeds)))
    times_s = np.arange(0.0, passed_s[-1], STEP_S)
    rover = np.column_stack([np.interp(times_s, passed_s, line[:, axis]) for axis in (0, 1)])
    for mover in problem.moving_obstacles:
        track = mover.track
        there = np.column_stack([np.interp(times_s, track[:, 0], track[:, axis]) for axis in (1, 2)])
        near = np.flatnonzero(np.hypot(*(rover - there).T) < mover.radius_fields - SLACK_FIELDS)
        if len(near):
            x, y = rover[near[0]]
            return f"it meets one {times_s[near[0]]:.1f} s after the start, at {x:.1f}, {y:.1f}"
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
