"""Rasterised lines, and tests and costs of paths of fields. Compiled.

Lines are drawn with the DDA (digital differential analyser): one field per unit of the longer side. So a line is
8-connected and cannot skip a thin wall. Arrays of fields have shape ``(n, 2)``, columns x and y.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights
from companion.planning.problem import MIN_WEIGHT

CellArray = NDArray[np.int64]

ONE = 1 << 32
"""1 in fixed point: coordinates are whole multiples of 1 / ONE, exact to 1e-6 fields over 4000 fields."""
HALF = 1 << 31
SHIFT = 32
SQRT2 = math.sqrt(2.0)
ROUND = (5, 8, 7, 6, 3, 0, 1, 2)
"""The eight steps anticlockwise from +x, numbered 3 (dy + 1) + dx + 1."""


@njit(cache=True, nogil=True)
def fine_steps(delta_x: int, delta_y: int) -> tuple[int, int, int]:
    """The number of steps of a line, and what one adds to x and y in fixed point."""
    steps = max(abs(delta_x), abs(delta_y))
    share = ONE / max(steps, 1)
    return steps, int(delta_x * share), int(delta_y * share)


@njit(cache=True, nogil=True)
def line_into(cells: CellArray, used: int, x0: int, y0: int, x1: int, y1: int) -> int:
    """Write the fields of a line after ``cells[:used]``, without its first field. Returns how many are used then."""
    steps, step_x, step_y = fine_steps(x1 - x0, y1 - y0)
    fine_x, fine_y = x0 * ONE + HALF, y0 * ONE + HALF
    for i in range(steps):
        fine_x += step_x
        fine_y += step_y
        cells[used + i, 0] = fine_x >> SHIFT
        cells[used + i, 1] = fine_y >> SHIFT
    return used + steps


@njit(cache=True, nogil=True)
def polyline(points: CellArray) -> CellArray:
    """The fields under straight lines from point to point, 8-connected, each joint once. Needs at least one point."""
    total = 1
    for i in range(1, len(points)):
        total += max(abs(points[i, 0] - points[i - 1, 0]), abs(points[i, 1] - points[i - 1, 1]))
    cells = np.empty((total, 2), np.int64)
    cells[0, 0] = points[0, 0]
    cells[0, 1] = points[0, 1]
    used = 1
    for i in range(1, len(points)):
        used = line_into(cells, used, points[i - 1, 0], points[i - 1, 1], points[i, 0], points[i, 1])
    return cells


@njit(cache=True, nogil=True)
def _slot(table: NDArray[np.int64], cells: CellArray, x: int, y: int) -> int:
    """The slot of a field in an open-addressed hash table of indices into ``cells`` (-1 = empty)."""
    mask = len(table) - 1
    at = ((x * 73856093) ^ (y * 19349663)) & mask
    while table[at] >= 0 and (cells[table[at], 0] != x or cells[table[at], 1] != y):
        at = (at + 1) & mask
    return at


@njit(cache=True, nogil=True)
def _never_turns_back(cells: CellArray) -> bool:
    """Whether all steps of a walk lie within less than half a turn. Then it visits no field twice."""
    taken = 0
    for i in range(1, len(cells)):
        step = 3 * (cells[i, 1] - cells[i - 1, 1]) + cells[i, 0] - cells[i - 1, 0] + 4
        if not 0 <= step < 9:
            return False
        taken |= 1 << step
    for eighth in range(8):
        four = 0
        for k in range(4):
            four |= 1 << ROUND[(eighth + k) & 7]
        if taken & ~four == 0:
            return True
    return False


@njit(cache=True, nogil=True)
def without_loops(cells: CellArray) -> CellArray:
    """The same walk with everything between two visits of a field cut out (paper, section 4.6).

    Neighbours stay neighbours and the ends stay the ends. Takes linear time. A walk without loops is returned as it is.
    """
    if _never_turns_back(cells):
        return cells
    size = 16
    while size < 2 * len(cells):
        size *= 2
    last_visit = np.full(size, -1, np.int64)
    for i in range(len(cells)):
        last_visit[_slot(last_visit, cells, cells[i, 0], cells[i, 1])] = i
    kept = np.empty_like(cells)
    used = 0
    i = 0
    while i < len(cells):
        kept[used, 0] = cells[i, 0]
        kept[used, 1] = cells[i, 1]
        used += 1
        i = last_visit[_slot(last_visit, cells, cells[i, 0], cells[i, 1])] + 1
    return kept[:used].copy()


@njit(cache=True, nogil=True)
def cells_cost(weights: Weights, cells: CellArray) -> float:
    """``problem.path_cost`` for an array of fields, all inside the map."""
    cost = 0.0
    for i in range(1, len(cells)):
        x, y = cells[i, 0], cells[i, 1]
        length = SQRT2 if x != cells[i - 1, 0] and y != cells[i - 1, 1] else 1.0
        cost += length * max(weights[y, x], MIN_WEIGHT)
    return cost


class PathFault(StrEnum):
    """What can be wrong with a row of fields."""

    NONE = "none"
    OUTSIDE_MAP = "outside the map"
    OBSTACLE = "obstacle"
    NOT_ADJACENT = "not adjacent"
    CORNER_CUT = "corner cut"
    WRONG_ENDS = "wrong ends"
    """Its ends are not start and target, which ``first_fault`` does not know."""


FAULTS = tuple(PathFault)
"""The faults that ``first_fault`` can find, by number."""


@njit(cache=True, nogil=True)
def first_fault(weights: Weights, cells: CellArray, corner_cutting: bool) -> tuple[int, int]:
    """The first fault of a row of fields: (index into FAULTS, index of the field); (0, -1) if it is a correct path."""
    height, width = weights.shape
    for i in range(len(cells)):
        x, y = cells[i, 0], cells[i, 1]
        if not (0 <= x < width and 0 <= y < height):
            return 1, i
        if weights[y, x] >= OBSTACLE:
            return 2, i
        if i == 0:
            continue
        from_x, from_y = cells[i - 1, 0], cells[i - 1, 1]
        if max(abs(x - from_x), abs(y - from_y)) != 1:
            return 3, i
        cuts = weights[from_y, x] >= OBSTACLE or weights[y, from_x] >= OBSTACLE
        if cuts and x != from_x and y != from_y and not corner_cutting:
            return 4, i
    return 0, -1


def plain(weights: Weights) -> Weights:
    """The weights as the kernels need them: float64, row after row, writeable. Copies them only if they are not."""
    if weights.flags.carray and weights.dtype == np.float64:
        return weights
    return np.array(weights, np.float64, order="C")
