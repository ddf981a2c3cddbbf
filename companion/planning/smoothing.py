"""Path smoothing: a path of fields becomes the smooth curve that a rover can drive fast. Compiled.

At every sharp bend a rover must stop and turn on the spot. So the staircase of a graph search is first pulled straight
wherever the straight line costs no more than the fields it replaces. The corners that remain are rounded by a B-spline
of degree 2, as widely as the ground beside them allows.

Nouns: smoothing.
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
"""How far from a corner its rounding begins; tried in turn."""
SLACK = 1.02
"""A straight line may cost so many times what it replaces: a staircase and the line beside it differ a little."""
SAMPLES_A_CORNER = 8
CORRIDOR_FIELDS = 8
"""A shorter path is searched within this distance of the straightened one."""
EVEN_SHARE = 0.5
SIDE_WEIGHT = 0.9
"""When a path is made taut, fields beside an obstacle have this weight and others EVEN_SHARE of their own: with room
beside it a rover goes round corners faster and more reliably."""
ROOM_SHARE = 1.15
"""A path with room beside it may cost so many times the path that it replaces."""
TAUT_FIELDS = 400
"""Only the beginning of a path is made taut, up to this length."""
PIECE_FIELDS = 0.5
GRAZED_WEIGHT = 10.0
"""The weight of an obstacle that a curve touches between its points: finite, because it may be only a corner."""

Mask = NDArray[np.bool_]
Curve = NDArray[np.float64]
"""Shape (n, 2): columns x and y in fields."""
Direction = tuple[float, float]


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
        # The farthest field in straight reach: by doubling steps, then back one by one. The next field always is.
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
    """The curve through straightened corners, shape (n, 2) in fields. Corners without room beside them stay sharp."""
    count = len(corners)
    points = np.empty((count * (SAMPLES_A_CORNER + 1) + 2, 2))
    points[0, 0], points[0, 1] = corners[0, 0], corners[0, 1]
    used = 1
    for i in range(1, count - 1):
        into_x, into_y = float(corners[i, 0] - corners[i - 1, 0]), float(corners[i, 1] - corners[i - 1, 1])
        out_x, out_y = float(corners[i + 1, 0] - corners[i, 0]), float(corners[i + 1, 1] - corners[i, 1])
        before, after = math.hypot(into_x, into_y), math.hypot(out_x, out_y)
        into, out = (into_x / before, into_y / before), (out_x / after, out_y / after)
        written = 0
        for rounding in ROUNDING_FIELDS:
            reach = min(rounding, before / 2.0, after / 2.0)
            written = _arc(points, used, corners[i], into, out, reach)
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
def _arc(points: Curve, used: int, corner: CellArray, into: Direction, out: Direction, reach: float) -> int:
    """One span of the B-spline, from ``reach`` before the corner to as far beyond it.

    Returns how many points were written.

    ``into`` and ``out``: unit vectors along the path before and after the corner.
    """
    from_x, from_y = corner[0] - reach * into[0], corner[1] - reach * into[1]
    to_x, to_y = corner[0] + reach * out[0], corner[1] + reach * out[1]
    for k in range(SAMPLES_A_CORNER + 1):
        t = k / SAMPLES_A_CORNER
        a, b, c = (1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t
        points[used + k, 0] = a * from_x + b * corner[0] + c * to_x
        points[used + k, 1] = a * from_y + b * corner[1] + c * to_y
    return SAMPLES_A_CORNER + 1


@njit(cache=True, nogil=True)
def _is_free(weights: Weights, points: NDArray[np.float64], used: int, written: int) -> bool:
    """Whether the fields under the lines between these points are a correct path."""
    cells = np.empty((written, 2), np.int64)
    for k in range(written):
        cells[k, 0] = math.floor(points[used + k, 0] + 0.5)
        cells[k, 1] = math.floor(points[used + k, 1] + 0.5)
    return bool(first_fault(weights, polyline(cells), False)[0] == 0)


@njit(cache=True, nogil=True)
def _is_cheap(weights: Weights, arc: NDArray[np.float64], corner: NDArray[np.int64]) -> bool:
    """Whether an arc costs no more than the path through the corner: ground beside obstacles may be costly."""
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
    """Set obstacles as in ``before``, and free fields beside one to SIDE_WEIGHT. All others are cheap already."""
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
    """Corners of a shorter path near a straightened one: ends included, each in clear sight of the next.

    A graph search measures a path in steps, and takes any of the paths with equally many; their lengths in metres
    differ by up to a twelfth. Only the beginning of a very long path is made taut: a rover replans long before it
    reaches the rest.
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
    # The search took all fields beside obstacles as alike. Where they are not, room could cost too much.
    if curve_cost(weights, shorter.astype(np.float64)) > ROOM_SHARE * curve_cost(weights, head.astype(np.float64)):
        return corners
    return np.concatenate((shorter, corners[count:]))


def smooth(weights: Weights, cells: CellArray) -> Curve:
    """The curve for a path of fields, shape (n, 2), columns x and y in fields, from its first field to its last."""
    if len(cells) < 3:
        return cells.astype(np.float64)
    corners = taut(weights, straightened(weights, cells))
    curve = rounded(weights, corners)
    # Arcs begin and end between fields, so a line from one to the next may touch what the line between corners does
    # not.
    return curve if _is_free(weights, curve, 0, len(curve)) else corners.astype(np.float64)


@njit(cache=True, nogil=True)
def curve_cost(weights: Weights, curve: Curve) -> float:
    """The cost of driving along a curve: its length in fields times the weight of the fields under it.

    Off the map, where a genetic curve may lead between its way points, it is that of an obstacle.
    """
    height, width = weights.shape
    total = 0.0
    for i in range(1, len(curve)):
        along_x, along_y = curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1]
        length = math.hypot(along_x, along_y)
        pieces = math.ceil(length / PIECE_FIELDS)
        for k in range(pieces):
            share = (k + 0.5) / pieces
            x, y = curve[i - 1, 0] + share * along_x, curve[i - 1, 1] + share * along_y
            row, column = math.floor(y + 0.5), math.floor(x + 0.5)
            is_on_map = 0 <= row < height and 0 <= column < width
            weight = weights[row, column] if is_on_map else OBSTACLE
            total += (GRAZED_WEIGHT if weight >= OBSTACLE else max(weight, MIN_WEIGHT)) * length / pieces
    return total
