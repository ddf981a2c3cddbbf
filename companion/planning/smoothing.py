"""A path of fields made into the smooth curve that a rover likes to drive. Compiled.

Every sharp bend costs a rover a stop and a turn on the spot. So the staircase of a graph search is first pulled straight wherever the
straight line costs no more than the fields it replaces, and what corners are left are rounded by a 2nd-degree B-spline, as wide as the
ground beside them allows.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.graph_search.theta_star import any_angle
from companion.planning.problem import MIN_WEIGHT
from companion.planning.raster import CellArray, cells_cost, first_fault, polyline, without_loops

ROUNDING_FIELDS = (6.0, 4.0, 2.5, 1.5, 0.75)
"""How far from a corner its rounding begins, tried in turn."""
SLACK = 1.02
"""A straight line may cost so many times what it replaces: a stair is a little dearer than the line beside it."""
SAMPLES_A_CORNER = 8
CORRIDOR_FIELDS = 8
"""So far beside a straightened path a shorter one is looked for."""
EVEN_SHARE = 0.5
SIDE_WEIGHT = 0.9
"""Fields beside an obstacle are this dear when a path is made taut, and others a quarter of what they are: a rover goes round corners
faster, and with less doubt, where there is room beside it."""
ROOM_SHARE = 1.15
"""A path with room beside it may cost so many times the one that it takes the place of."""
TAUT_FIELDS = 400
"""So long a beginning of a path is made taut."""
PIECE_FIELDS = 0.5
GRAZED_WEIGHT = 10.0
"""What an obstacle counts that a curve touches between the fields under its points: it may be no more than a corner."""

Mask = NDArray[np.bool_]
Curve = NDArray[np.float64]
"""Shape (n, 2): columns x and y in fields."""


@njit(cache=True, nogil=True)
def straightened(weights: Weights, cells: CellArray) -> CellArray:
    """The corners that are left when the path is pulled straight: a subset of the path's fields, ends included."""
    count = len(cells)
    reached = np.zeros(count)
    for i in range(1, count):
        reached[i] = reached[i - 1] + cells_cost(weights, cells[i - 1 : i + 1])
    kept = np.empty((count, 2), np.int64)
    kept[0] = cells[0]
    used, at = 1, 0
    ends = np.empty((2, 2), np.int64)
    while at < count - 1:
        # The farthest field in straight reach: doubling steps, then back one by one. Near fields always are.
        step, far = 1, at + 1
        while at + step < count:
            ends[0], ends[1] = cells[at], cells[at + step]
            if not _is_straight(weights, ends, reached[at + step] - reached[at]):
                break
            far = at + step
            step *= 2
        for i in range(min(at + step, count - 1), far, -1):
            ends[0], ends[1] = cells[at], cells[i]
            if _is_straight(weights, ends, reached[i] - reached[at]):
                far = i
                break
        kept[used] = cells[far]
        used += 1
        at = far
    return kept[:used].copy()


@njit(cache=True, nogil=True)
def _is_straight(weights: Weights, ends: CellArray, cost: float) -> bool:
    """Whether the line between two fields is free and costs no more than the path between them."""
    line = polyline(ends)
    return bool(first_fault(weights, line, False)[0] == 0) and cells_cost(weights, line) <= SLACK * cost + 1e-9


@njit(cache=True, nogil=True)
def rounded(weights: Weights, corners: CellArray) -> NDArray[np.float64]:
    """The curve through straightened corners, shape (n, 2) in fields. Corners with no room beside them stay sharp."""
    count = len(corners)
    points = np.empty((count * (SAMPLES_A_CORNER + 1) + 2, 2))
    points[0, 0], points[0, 1] = corners[0, 0], corners[0, 1]
    used = 1
    for i in range(1, count - 1):
        into_x, into_y = float(corners[i, 0] - corners[i - 1, 0]), float(corners[i, 1] - corners[i - 1, 1])
        out_x, out_y = float(corners[i + 1, 0] - corners[i, 0]), float(corners[i + 1, 1] - corners[i, 1])
        into, out = math.hypot(into_x, into_y), math.hypot(out_x, out_y)
        written = 0
        for rounding in ROUNDING_FIELDS:
            reach = min(rounding, into / 2.0, out / 2.0)
            written = _arc(points, used, corners[i], into_x / into, into_y / into, out_x / out, out_y / out, reach)
            if _is_free(weights, points, used - 1, written + 1) and _is_cheap(
                weights, points[used : used + written], corners[i]
            ):
                break
            written = 0
        if written == 0:
            points[used, 0], points[used, 1] = corners[i, 0], corners[i, 1]
            written = 1
        used += written
    points[used, 0], points[used, 1] = corners[-1, 0], corners[-1, 1]
    return points[: used + 1].copy()


@njit(cache=True, nogil=True)
def _arc(
    points: NDArray[np.float64],
    used: int,
    corner: NDArray[np.int64],
    into_x: float,
    into_y: float,
    out_x: float,
    out_y: float,
    reach: float,
) -> int:
    """One span of the B-spline: from ``reach`` before the corner to as far beyond it. How many points were written."""
    from_x, from_y = corner[0] - reach * into_x, corner[1] - reach * into_y
    to_x, to_y = corner[0] + reach * out_x, corner[1] + reach * out_y
    for k in range(SAMPLES_A_CORNER + 1):
        t = k / SAMPLES_A_CORNER
        a, b, c = (1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t
        points[used + k, 0] = a * from_x + b * corner[0] + c * to_x
        points[used + k, 1] = a * from_y + b * corner[1] + c * to_y
    return SAMPLES_A_CORNER + 1


@njit(cache=True, nogil=True)
def _is_free(weights: Weights, points: NDArray[np.float64], used: int, written: int) -> bool:
    """Whether nothing is wrong with the fields under these points, joined by lines."""
    cells = np.empty((written, 2), np.int64)
    for k in range(written):
        cells[k, 0] = math.floor(points[used + k, 0] + 0.5)
        cells[k, 1] = math.floor(points[used + k, 1] + 0.5)
    return bool(first_fault(weights, polyline(cells), False)[0] == 0)


@njit(cache=True, nogil=True)
def _is_cheap(weights: Weights, arc: NDArray[np.float64], corner: NDArray[np.int64]) -> bool:
    """Whether an arc does not lead over dearer ground than the way through the corner: beside obstacles ground is dear."""
    around = np.empty((3, 2), np.int64)
    for axis in range(2):
        around[0, axis] = math.floor(arc[0, axis] + 0.5)
        around[1, axis] = corner[axis]
        around[2, axis] = math.floor(arc[-1, axis] + 0.5)
    return cells_cost(weights, fields_under(arc)) <= SLACK * cells_cost(weights, polyline(around)) + 1e-9


@njit(cache=True, nogil=True)
def fields_under(curve: NDArray[np.float64]) -> CellArray:
    """The fields under a curve, each once."""
    cells = np.empty((len(curve), 2), np.int64)
    for k in range(len(curve)):
        cells[k, 0] = math.floor(curve[k, 0] + 0.5)
        cells[k, 1] = math.floor(curve[k, 1] + 0.5)
    return without_loops(polyline(cells))


@njit(cache=True, nogil=True)
def _fill_corridor(corridor: Mask, width: int, corners: CellArray) -> None:
    """Mark the fields within ``CORRIDOR_FIELDS`` of the lines from corner to corner."""
    line = polyline(corners)
    height = len(corridor) // width
    for i in range(len(line)):
        left, right = max(line[i, 0] - CORRIDOR_FIELDS, 0), min(line[i, 0] + CORRIDOR_FIELDS, width - 1)
        low, high = max(line[i, 1] - CORRIDOR_FIELDS, 0), min(line[i, 1] + CORRIDOR_FIELDS, height - 1)
        for y in range(low, high + 1):
            corridor[y * width + left : y * width + right + 1] = True


@njit(cache=True, nogil=True)
def _mark_sides(around: Weights, before: Weights) -> None:
    """Obstacles as they were, and free fields beside one as dear as can be; all others have been made cheap."""
    height, width = around.shape
    for y in range(height):
        for x in range(width):
            if before[y, x] >= EVEN_SHARE * OBSTACLE:
                around[y, x] = OBSTACLE
                for to_y in range(max(y - 1, 0), min(y + 2, height)):
                    for to_x in range(max(x - 1, 0), min(x + 2, width)):
                        if around[to_y, to_x] < OBSTACLE:
                            around[to_y, to_x] = SIDE_WEIGHT


def taut(weights: Weights, corners: CellArray) -> CellArray:
    """Corners of a shorter path beside one that has been pulled straight: ends included, each in clear sight of the next.

    A graph search counts a way in steps, and of many ways with as many steps takes any; the difference in metres is up to a twelfth.
    Of a very long path only the beginning is made taut: a rover plans anew long before it comes to the rest.
    """
    reached = np.abs(np.diff(corners, axis=0)).max(axis=1, initial=0).cumsum()
    count = 1 + int(np.searchsorted(reached, TAUT_FIELDS, "right"))
    if count < 3:
        return corners
    head = corners[:count]
    low = np.maximum(head.min(axis=0) - CORRIDOR_FIELDS, 0)
    high = head.max(axis=0) + CORRIDOR_FIELDS + 1
    around = EVEN_SHARE * weights[low[1] : high[1], low[0] : high[0]]
    corridor = np.zeros(around.size, np.bool_)
    _fill_corridor(corridor, around.shape[1], head - low)
    _mark_sides(around, around.copy())
    start, end = (Cell(*place.tolist()) for place in (head[0] - low, head[-1] - low))
    shorter = any_angle(around, start, end, False, corridor) + low
    # Beside obstacles all fields have been made alike: where they are not, room could be bought too dearly.
    if curve_cost(weights, shorter.astype(np.float64)) > ROOM_SHARE * curve_cost(weights, head.astype(np.float64)):
        return corners
    return np.concatenate((shorter, corners[count:]))


def smooth(weights: Weights, cells: CellArray) -> Curve:
    """The curve for a path of fields, shape (n, 2), columns x and y in fields, from its first field to its last."""
    if len(cells) < 3:
        return cells.astype(np.float64)
    corners = taut(weights, straightened(weights, cells))
    curve = rounded(weights, corners)
    # Arcs begin and end between fields, so a line from one to the next may clip what the line between the corners does not.
    return curve if _is_free(weights, curve, 0, len(curve)) else corners.astype(np.float64)


@njit(cache=True, nogil=True)
def curve_cost(weights: Weights, curve: Curve) -> float:
    """The length of a curve, in fields, times the weight of the fields under it: what driving along it costs."""
    total = 0.0
    for i in range(1, len(curve)):
        along_x, along_y = curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1]
        length = math.hypot(along_x, along_y)
        pieces = math.ceil(length / PIECE_FIELDS)
        for k in range(pieces):
            share = (k + 0.5) / pieces
            x, y = curve[i - 1, 0] + share * along_x, curve[i - 1, 1] + share * along_y
            weight = weights[math.floor(y + 0.5), math.floor(x + 0.5)]
            total += (GRAZED_WEIGHT if weight >= OBSTACLE else max(weight, MIN_WEIGHT)) * length / pieces
    return total
