"""Theta*: graph search whose path may turn at any angle. Compiled.

Nash, Koenig & Tovey 2010 (Lazy Theta*). A field's predecessor need not be its neighbour: it may be any field in a
straight line of sight. A new field is given its neighbour's predecessor without a check. The line is checked only when
the field is expanded, once for each field. If it is blocked, or costlier than a step from a neighbour, the best
neighbour becomes the predecessor.

In the paper ground is free or blocked. Here it has weights, so a straight line costs its length times the mean weight
of the fields under it, and is used only where that is no costlier.

Nouns: Theta*.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.graph_search.heap import Queue, empty_queue, put, take_out
from companion.planning.graph_search.steps import STEP_X, STEP_Y, least_cost, step_cost
from companion.planning.planner import Capabilities, CompletePlanner
from companion.planning.problem import MIN_WEIGHT, Path, PlanningProblem
from companion.planning.raster import (
    HALF,
    ONE,
    SHIFT,
    SQRT2,
    CellArray,
    cells_cost,
    fine_steps,
    polyline,
    without_loops,
)

Floats = NDArray[np.float64]
Fields = NDArray[np.int32]
Mask = NDArray[np.bool_]
ANYWHERE: Mask = np.zeros(0, np.bool_)
SHORT_PIECE = 16
"""A piece of a line with at most so many fields is checked field by field."""
START_COST = 1e-300
"""The cost of the start: not 0, which means not reached, but too small to change any sum."""


class Ground(NamedTuple):
    """The map, and what makes the cost of a line fast.

    ``counts``: see ``others_before``; pieces of a line over ground of the weight ``even`` are not checked field by
    field.
    """

    weights: Floats
    counts: Fields
    even: float
    corner_cutting: bool


class Search(NamedTuple):
    """A search; arrays have an entry for each field.

    ``reached``: the cost of a field, 0 not reached, positive before and negative after the check of its line.
    ``come_from``: its predecessor; the start is its own. ``corridor``: True where corners of the path may be; empty:
    anywhere.
    """

    ground: Ground
    reached: Floats
    come_from: Fields
    queue: Queue
    corridor: Mask


@njit(cache=True, nogil=True, inline="always")
def _length(x: int, y: int) -> float:
    """As ``math.hypot`` without its guard against overflow, which takes several times as long."""
    return math.sqrt(float(x * x + y * y))


@njit(cache=True, nogil=True)
def others_before(weights: Floats, even: float) -> Fields:
    """Shape (height + 1, width + 1): how many fields with smaller y and smaller x have another weight than this."""
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
    """Whether all fields of the rectangle between two have the weight that ``counts`` was made for."""
    left, right, low, high = min(x0, x1), max(x0, x1) + 1, min(y0, y1), max(y0, y1) + 1
    return bool(counts[high, right] - counts[high, left] - counts[low, right] + counts[low, left] == 0)


@njit(cache=True, nogil=True, forceinline=True)
def line_cost(ground: Ground, x0: int, y0: int, x1: int, y1: int) -> float:
    """The cost of the line between two different fields, drawn as by ``raster.polyline``; inf if it is blocked."""
    weights, counts, even, corner_cutting = ground
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


@njit(cache=True, nogil=True, forceinline=True)
def _check_line(search: Search, field: int) -> float:
    """Check the line to the field from its predecessor and, if need be, replace the predecessor. The field's cost."""
    ground, reached, come_from = search.ground, search.reached, search.come_from
    weights, corner_cutting = ground.weights, ground.corner_cutting
    width = weights.shape[1]
    x, y, seen_from = field % width, field // width, come_from[field]
    best = -reached[seen_from] + line_cost(ground, seen_from % width, seen_from // width, x, y)
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
def _is_found(search: Search, start: int, target: int) -> bool:
    """Search until the target is expanded (True) or nothing is left to expand (False)."""
    ground, reached, come_from, queue, corridor = search
    weights, corner_cutting = ground.weights, ground.corner_cutting
    anywhere = len(corridor) == 0
    width = weights.shape[1]
    target_x, target_y = target % width, target // width
    least = least_cost(weights.ravel(), ground.even)
    reached[start], come_from[start] = START_COST, start
    put(queue, start, 0.0, 0.0)
    while queue.heap[0] > 0:
        here = queue.heap[1]
        take_out(queue, here)
        reached[here] = -_check_line(search, here) if here != start else -START_COST
        if here == target:
            return True
        x, y = here % width, here // width
        # The predecessor of this field may see its neighbours too: the cost along that line grows by the step's share.
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
            put(queue, field, cost + ahead, -cost)
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
    corner_cutting: bool,
    start: int,
    target: int,
    reached: Floats,
    come_from: Fields,
    queue: Queue,
    corridor: Mask,
) -> CellArray:
    """The corners of the path; no rows if there is none. ``reached`` and ``come_from`` are zeros."""
    width = weights.shape[1]
    even = weights[target // width, target % width]
    ground = Ground(weights, others_before(weights, even), even, corner_cutting)
    if not _is_found(Search(ground, reached, come_from, queue, corridor), start, target):
        return np.empty((0, 2), np.int64)
    return _corners(come_from, width, target)


def any_angle(weights: Floats, start: Cell, target: Cell, corner_cutting: bool, corridor: Mask = ANYWHERE) -> CellArray:
    """The corners of the path from a free field to another, ends included: shape (n, 2), no rows if there is none.

    ``corridor``: True for fields, row after row, where corners may be; empty: anywhere.
    """
    fields, width = weights.size, weights.shape[1]
    ends = (start.y * width + start.x, target.y * width + target.x)
    # numpy's zeros come from the system when they are used, so only what is searched is ever touched.
    reached, come_from = np.zeros(fields), np.zeros(fields, np.int32)
    return _any_angle(weights, corner_cutting, *ends, reached, come_from, empty_queue(fields), corridor)


@njit(cache=True, nogil=True)
def _drawn(weights: Floats, corners: CellArray) -> tuple[CellArray, float]:
    """The fields of the path and their cost."""
    cells = without_loops(polyline(corners))
    return cells, cells_cost(weights, cells)


class ThetaStar(CompletePlanner):
    """A path of straight lines at any angle, nearly as short as possible, or the proof that there is none."""

    name = "theta-star"
    capabilities = Capabilities(proves_no_path=True, any_angle=True)

    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        corners = any_angle(weights, problem.start, problem.target, problem.corner_cutting)
        if len(corners) == 0:
            return None
        cells, cost = _drawn(weights, corners)
        return Path(cells, cost, corners.astype(np.float64))
