"""The obstacles of a map as polygons (shapely), for planners whose paths go from corner to corner.

A polygon is an obstacle enlarged by the safe distance and rounded outward to field centres, so that a rover may be at
its corners. Lines between corners that stay outside the polygons are correct paths when they are drawn on the fields:
they touch no field of an obstacle and cut no corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights, inflated

Ints = NDArray[np.int64]

GROWTH = 0.25
"""An obstacle is enlarged by this beyond its fields. So obstacles that touch at a corner are joined, two with a free
field between them are not, and rounding a corner to whole fields always moves it outward."""
NOTCH_FIELDS = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class Polygons:
    """All obstacles of a map, numbered from 1.

    ``owner``: the obstacle of each field, 0 where the rover may go, shape (height, width). ``corners``: shape (n, 2),
    columns x and y in fields, ring after ring; a few may be outside the map. ``rings``: shape (r, 2), columns first
    corner and the index after the last. The rings of obstacle i are ``obstacle_rings[i - 1]`` to ``obstacle_rings[i]``.
    """

    owner: NDArray[np.int32]
    corners: Ints
    rings: Ints
    obstacle_rings: Ints


@njit(cache=True, nogil=True)
def rectangles(weights: Weights) -> Ints:
    """Rectangles that together cover the obstacle fields: columns first x, first y, last x, last y."""
    height, width = weights.shape
    runs = 0
    for y in range(height):
        for x in range(width):
            if weights[y, x] >= OBSTACLE and (x == 0 or weights[y, x - 1] < OBSTACLE):
                runs += 1
    boxes = np.empty((runs, 4), np.int64)
    latest = np.full(width, -1, np.int64)  # the rectangle that begins at each x
    used = 0
    for y in range(height):
        x = 0
        while x < width:
            if weights[y, x] < OBSTACLE:
                x += 1
                continue
            first = x
            while x < width and weights[y, x] >= OBSTACLE:
                x += 1
            above = latest[first]
            if above >= 0 and boxes[above, 2] == x - 1 and boxes[above, 3] == y - 1:
                boxes[above, 3] = y
                continue
            boxes[used, 0], boxes[used, 1], boxes[used, 2], boxes[used, 3] = first, y, x - 1, y
            latest[first] = used
            used += 1
    return boxes[:used].copy()


@njit(cache=True, nogil=True)
def _painted(height: int, width: int, boxes: Ints, owners: Ints) -> NDArray[np.int32]:
    owner = np.zeros((height, width), np.int32)
    for i in range(len(boxes)):
        for y in range(boxes[i, 1], boxes[i, 3] + 1):
            for x in range(boxes[i, 0], boxes[i, 2] + 1):
                owner[y, x] = owners[i]
    return owner


@njit(cache=True, nogil=True)
def without_notches(corners: Ints, depth: float) -> Ints:
    """A ring (obstacle to the left) without the corners that no shortest path needs.

    Those are points on a straight side, and inward corners no deeper than ``depth``, as in the staircase of a slanting
    side. Outward corners stay, so the polygon only grows, by notches that are too small to drive into.
    """
    count = len(corners)
    after, before = np.arange(1, count + 1) % count, np.arange(-1, count - 1) % count
    dropped = np.zeros(count, np.bool_)
    left, at, unchanged = count, 0, 0
    while left > 3 and unchanged <= left:
        p, n = before[at], after[at]
        ax, ay = corners[at, 0] - corners[p, 0], corners[at, 1] - corners[p, 1]
        bx, by = corners[n, 0] - corners[at, 0], corners[n, 1] - corners[at, 1]
        turn = ax * by - ay * bx
        if turn == 0 or (turn < 0 and -turn <= depth * math.hypot(ax + bx, ay + by)):
            dropped[at] = True
            after[p], before[n] = n, p
            left -= 1
            unchanged = 0
            at = p  # the one before has a new neighbour: check it again
        else:
            unchanged += 1
            at = n
    return corners[~dropped]


@njit(cache=True, nogil=True)
def _counter_clockwise(corners: Ints) -> bool:
    area = 0
    for i in range(len(corners)):
        area += corners[i - 1, 0] * corners[i, 1] - corners[i, 0] * corners[i - 1, 1]
    return area > 0


def _rings_of(parts: NDArray[np.object_]) -> tuple[list[Ints], Ints]:
    """The rounded rings of the polygons, obstacle to the left, and the number of the polygon of each."""
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    points, ring_of_point = shapely.get_coordinates(rings, return_index=True)
    whole = np.rint(points).astype(np.int64)
    borders = np.searchsorted(ring_of_point, np.arange(len(rings) + 1))
    made = []
    for i in range(len(rings)):
        ring = whole[borders[i] : borders[i + 1] - 1]  # the last point repeats the first
        outer = i == 0 or part_of_ring[i] != part_of_ring[i - 1]
        if _counter_clockwise(ring) != outer:
            ring = ring[::-1]
        made.append(without_notches(np.ascontiguousarray(ring), NOTCH_FIELDS))
    return made, np.asarray(part_of_ring, np.int64)


def polygons_of(weights: Weights, safe_fields: float) -> Polygons:
    """The obstacles of a map (float64, row after row), enlarged to keep ``safe_fields`` from their fields.

    The minimum is half a field, the distance of a field's centre from its edge. See ``Polygons``.
    """
    if safe_fields > 0.5:
        weights = inflated(weights, safe_fields)
    boxes = rectangles(weights)
    height, width = weights.shape
    if len(boxes) == 0:
        return Polygons(
            np.zeros((height, width), np.int32),
            np.empty((0, 2), np.int64),
            np.empty((0, 2), np.int64),
            np.zeros(1, np.int64),
        )
    low, high = boxes[:, :2] - (0.5 + GROWTH), boxes[:, 2:] + (0.5 + GROWTH)
    # A buffer of 0 around all of them unites them in half the time of union_all.
    parts = shapely.get_parts(shapely.buffer(shapely.multipolygons(shapely.box(*low.T, *high.T)), 0.0))
    tree = shapely.STRtree(parts)
    found = tree.query(shapely.points((low + high) / 2.0), predicate="intersects")
    owners = np.empty(len(boxes), np.int64)
    owners[found[0]] = found[1] + 1
    made, part_of_ring = _rings_of(parts)
    ends = np.cumsum([len(ring) for ring in made])
    return Polygons(
        _painted(height, width, boxes, owners),
        np.concatenate(made),
        np.column_stack((np.concatenate(([0], ends[:-1])), ends)).astype(np.int64),
        np.searchsorted(part_of_ring, np.arange(len(parts) + 1)).astype(np.int64),
    )
