"""Theta*: graph search whose path may turn at any angle. Compiled.

Nash, Koenig & Tovey 2010 (Lazy Theta*). A field's predecessor need not be its neighbour, but any field in a straight line of sight. A new field
is given its neighbour's predecessor on trust; the line is looked at only when the field's turn comes, once for each field, and if it is blocked,
or dearer than a step from a neighbour, the best neighbour takes its place.

The paper's ground is free or blocked. Here ground has weights, so a straight line costs its length times the mean weight of the
fields under it, and is taken only where that is no dearer.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell
from companion.planning.ends import ends_free
from companion.planning.graph_search.heap import put, take_out
from companion.planning.graph_search.steps import STEP_X, STEP_Y, least_cost, step_cost
from companion.planning.planner import Capabilities
from companion.planning.problem import MIN_WEIGHT, Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.raster import (
    HALF,
    ONE,
    SHIFT,
    SQRT2,
    CellArray,
    cells_cost,
    fine_steps,
    plain,
    polyline,
    without_loops,
)
from companion.settings import PlannerSettings

Floats = NDArray[np.float64]
Fields = NDArray[np.int32]
Mask = NDArray[np.bool_]
NO_CELLS = (0, 2)
ANYWHERE: Mask = np.zeros(0, np.bool_)
SHORT_PIECE = 16
"""So many fields of a line are looked at one by one."""
START_COST = 1e-300
"""What the start costs: not 0, which means not reached, but lost in any sum."""


@njit(cache=True, nogil=True, inline="always")
def _length(x: int, y: int) -> float:
    """``math.hypot`` guards against overflow, which takes several times as long."""
    return math.sqrt(float(x * x + y * y))


@njit(cache=True, nogil=True)
def others_before(weights: Floats, even: float) -> Fields:
    """Shape (height + 1, width + 1): how many fields with y and x less than these do not have this weight."""
    height, width = weights.shape
    counts = np.empty((height + 1, width + 1), np.int32)
    counts[0, :] = 0
    for y in range(height):
        counts[y + 1, 0] = 0
        row = 0
        for x in range(width):
            row += weights[y, x] != even
            counts[y + 1, x + 1] = counts[y, x + 1] + row
    return counts


@njit(cache=True, nogil=True)
def _is_even(counts: Fields, x0: int, y0: int, x1: int, y1: int) -> bool:
    """Whether all fields of the rectangle between two have the weight that ``counts`` were made for."""
    left, right, low, high = min(x0, x1), max(x0, x1) + 1, min(y0, y1), max(y0, y1) + 1
    return bool(counts[high, right] - counts[high, left] - counts[low, right] + counts[low, left] == 0)


@njit(cache=True, nogil=True)
def line_cost(
    weights: Floats, counts: Fields, even: float, x0: int, y0: int, x1: int, y1: int, corner_cutting: bool
) -> float:
    """The cost of the straight line between two different fields, drawn as ``raster.polyline`` does; inf if it is blocked.

    ``counts`` are ``others_before(weights, even)``: pieces of the line in even ground are not looked at field by field.
    """
    steps, step_x, step_y = fine_steps(x1 - x0, y1 - y0)
    fine_x, fine_y = x0 * ONE + HALF, y0 * ONE + HALF
    last_x, last_y, total, done = x0, y0, 0.0, 0
    while done < steps:
        piece = steps - done
        while True:
            x, y = (fine_x + piece * step_x) >> SHIFT, (fine_y + piece * step_y) >> SHIFT
            if _is_even(counts, last_x, last_y, x, y):
                total += piece * max(even, MIN_WEIGHT)
                break
            if piece <= SHORT_PIECE:
                cost = _piece_cost(weights, fine_x, fine_y, step_x, step_y, piece, corner_cutting)
                if cost == np.inf:
                    return np.inf
                total += cost
                break
            piece //= 2
        fine_x, fine_y, last_x, last_y, done = fine_x + piece * step_x, fine_y + piece * step_y, x, y, done + piece
    return float(_length(x1 - x0, y1 - y0) * total / steps)


@njit(cache=True, nogil=True)
def _piece_cost(
    weights: Floats, fine_x: int, fine_y: int, step_x: int, step_y: int, steps: int, corner_cutting: bool
) -> float:
    """The sum of the weights under so many fields of a line; inf if one is an obstacle or a corner is cut."""
    last_x, last_y, total = fine_x >> SHIFT, fine_y >> SHIFT, 0.0
    for _ in range(steps):
        fine_x += step_x
        fine_y += step_y
        x, y = fine_x >> SHIFT, fine_y >> SHIFT
        weight = weights[y, x]
        if weight >= OBSTACLE:
            return np.inf
        cuts = max(weights[last_y, x], weights[y, last_x]) >= OBSTACLE
        if cuts and x != last_x and y != last_y and not corner_cutting:
            return np.inf
        total += max(weight, MIN_WEIGHT)
        last_x, last_y = x, y
    return total


@njit(cache=True, nogil=True)
def _look(
    weights: Floats,
    counts: Fields,
    even: float,
    reached: Floats,
    come_from: Fields,
    field: int,
    corner_cutting: bool,
) -> float:
    """Look at the line that the field was reached by on trust; put right its predecessor if need be. What it costs."""
    width = weights.shape[1]
    x, y, seen_from = field % width, field // width, come_from[field]
    from_x, from_y = seen_from % width, seen_from // width
    best = -reached[seen_from] + line_cost(weights, counts, even, from_x, from_y, x, y, corner_cutting)
    for i in range(8):
        # From the field back to a neighbour; the step itself is the opposite one.
        back = step_cost(weights, x, y, i, corner_cutting)
        if back == np.inf:
            continue
        neighbour = (y + STEP_Y[i]) * width + x + STEP_X[i]
        cost = -reached[neighbour] + max(weights[y, x], MIN_WEIGHT) * (1.0 if i < 4 else SQRT2)
        if reached[neighbour] < 0.0 and cost < best - 1e-9:
            best = cost
            come_from[field] = neighbour
    return float(best)


@njit(cache=True, nogil=True)
def _search(
    weights: Floats,
    reached: Floats,
    come_from: Fields,
    heap: Fields,
    place: Fields,
    keys: Floats,
    start: int,
    target: int,
    corner_cutting: bool,
    corridor: Mask,
) -> bool:
    """Whether there is a way. Costs in ``reached`` as for A*: 0 not reached, positive on trust, negative looked at."""
    anywhere = len(corridor) == 0
    width = weights.shape[1]
    target_x, target_y = target % width, target // width
    even = weights[target_y, target_x]
    least, counts = least_cost(weights.ravel(), even), others_before(weights, even)
    reached[start], come_from[start] = START_COST, start
    size = put(heap, place, keys, 0, start, 0.0, 0.0)
    while size > 0:
        here = heap[0]
        size = take_out(heap, place, keys, size, here)
        reached[here] = (
            -_look(weights, counts, even, reached, come_from, here, corner_cutting) if here != start else -START_COST
        )
        if here == target:
            return True
        x, y = here % width, here // width
        # From where this field is seen its neighbours may be too: their cost grows along the line as it does by the step.
        seen_from = come_from[here]
        near_x, near_y, near_cost = x - seen_from % width, y - seen_from // width, -reached[seen_from]
        near = _length(near_x, near_y)
        for i in range(8):
            step = step_cost(weights, x, y, i, corner_cutting)
            to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
            field = to_y * width + to_x
            if step == np.inf or reached[field] < 0.0 or not (anywhere or corridor[field]):
                continue
            share = _length(near_x + STEP_X[i], near_y + STEP_Y[i]) / (near + (1.0 if i < 4 else SQRT2))
            cost = near_cost + (-reached[here] - near_cost + step) * share
            if reached[field] > 0.0 and cost >= reached[field]:
                continue
            reached[field], come_from[field] = cost, seen_from
            ahead = least * _length(target_x - to_x, target_y - to_y)
            size = put(heap, place, keys, size, field, cost + ahead, -cost)
    return False


@njit(cache=True, nogil=True)
def _corners(come_from: Fields, width: int, target: int) -> CellArray:
    """The fields where the path turns, and its ends."""
    count, here = 1, target
    while come_from[here] != here:
        here = come_from[here]
        count += 1
    corners = np.empty((count, 2), np.int64)
    here = target
    for i in range(count - 1, -1, -1):
        corners[i, 0], corners[i, 1] = here % width, here // width
        here = come_from[here]
    return corners


@njit(cache=True, nogil=True)
def _any_angle(
    weights: Floats,
    reached: Floats,
    come_from: Fields,
    heap: Fields,
    place: Fields,
    keys: Floats,
    start: int,
    target: int,
    corner_cutting: bool,
    corridor: Mask,
) -> CellArray:
    """The corners of the path; none if there is none. The arrays are zeros, one row for each field."""
    if not _search(weights, reached, come_from, heap, place, keys, start, target, corner_cutting, corridor):
        return np.empty(NO_CELLS, np.int64)
    return _corners(come_from, weights.shape[1], target)


def any_angle(weights: Floats, start: Cell, target: Cell, corner_cutting: bool, corridor: Mask = ANYWHERE) -> CellArray:
    """The corners of the path from a free field to another, ends included: shape (n, 2), no rows if there is none.

    ``corridor``: True for fields, row after row, where corners may be; empty: anywhere.
    """
    fields, width = weights.size, weights.shape[1]
    # Zeros of numpy's come from the system as needed: only what is searched is ever touched.
    waiting, place, come_from = (np.zeros(fields, np.int32) for _ in range(3))
    reached, keys = np.zeros(fields), np.zeros((fields, 2))
    ends = (start.y * width + start.x, target.y * width + target.x)
    return _any_angle(weights, reached, come_from, waiting, place, keys, *ends, corner_cutting, corridor)


@njit(cache=True, nogil=True)
def _drawn(weights: Floats, corners: CellArray) -> tuple[CellArray, float]:
    """The fields of the path and what they cost."""
    cells = without_loops(polyline(corners))
    return cells, cells_cost(weights, cells)


class ThetaStar:
    """A path of straight lines at any angle, nearly as short as can be, or the proof that there is none."""

    name = "theta-star"
    capabilities = Capabilities(proves_no_path=True, any_angle=True)

    def __init__(self, settings: PlannerSettings) -> None:
        del settings  # nothing to set

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH; budget and generator are left alone. The curve is the corners."""
        del budget, rng
        if not ends_free(problem):
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        weights = plain(problem.weights)
        corners = any_angle(weights, problem.start, problem.target, problem.corner_cutting)
        if len(corners) == 0:
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        cells, cost = _drawn(weights, corners)
        return PlanResult(PlanStatus.FOUND, Path(cells, cost, corners.astype(np.float64)), self.name)
