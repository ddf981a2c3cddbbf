"""The compiled part of D* Lite (Koenig & Likhachev 2002, the optimised version), which searches from the target.

Names are the paper's: ``g`` what a field cost to go from when it was last taken, ``rhs`` what its neighbours say it costs now; a field
waits in the queue exactly while the two differ. Fields are numbered row after row. A step costs as in ``path_cost``.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE
from companion.planning.graph_search.heap import put, take_out
from companion.planning.graph_search.steps import STEP_X, STEP_Y, octile
from companion.planning.problem import MIN_WEIGHT
from companion.planning.raster import SQRT2, CellArray

Floats = NDArray[np.float64]
Fields = NDArray[np.int32]


@njit(cache=True, nogil=True)
def changes(old: Floats, new: Floats, changed: NDArray[np.int64]) -> int:
    """Copy ``new`` to ``old`` and write which fields differ; how many do. If it is more than there is room: room + 1, half done."""
    count = 0
    for field in range(len(old)):
        if old[field] != new[field]:
            if count == len(changed):
                return count + 1
            changed[count] = field
            old[field] = new[field]
            count += 1
    return count


@njit(cache=True, nogil=True)
def step(weights: Floats, width: int, x: int, y: int, i: int, corner_cutting: bool) -> tuple[int, float, float]:
    """Step i from a field: where to, what it costs, and what the step back costs; -1 if it is not allowed."""
    here = y * width + x
    to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
    to = to_y * width + to_x
    if not (0 <= to_x < width and 0 <= to < len(weights)):
        return -1, np.inf, np.inf
    if max(weights[here], weights[to]) >= OBSTACLE:
        return -1, np.inf, np.inf
    if i < 4:
        return to, max(weights[to], MIN_WEIGHT), max(weights[here], MIN_WEIGHT)
    if not corner_cutting and max(weights[y * width + to_x], weights[to_y * width + x]) >= OBSTACLE:
        return -1, np.inf, np.inf
    return to, max(weights[to], MIN_WEIGHT) * SQRT2, max(weights[here], MIN_WEIGHT) * SQRT2


@njit(cache=True, nogil=True)
def cheapest_step(weights: Floats, width: int, g: Floats, here: int, corner_cutting: bool) -> tuple[int, float]:
    """The neighbour that the cheapest way goes on to, and what it costs; -1 and inf if there is none."""
    best, onward = np.inf, -1
    y = here // width
    x = here - y * width
    for i in range(8):
        to, cost, _ = step(weights, width, x, y, i, corner_cutting)
        if to >= 0 and cost + g[to] < best:
            best, onward = cost + g[to], to
    return onward, best


@njit(cache=True, nogil=True)
def queue(
    width: int,
    g: Floats,
    rhs: Floats,
    heap: Fields,
    place: Fields,
    keys: Floats,
    size: int,
    field: int,
    start: int,
    least: float,
    passed: float,
) -> int:
    """Let the field wait, with its key as of now, if its two numbers differ, and else not; the queue's size."""
    if g[field] == rhs[field]:
        return take_out(heap, place, keys, size, field)
    cost = min(g[field], rhs[field])
    # A product is much quicker than the rest of a division.
    y, start_y = field // width, start // width
    ahead = least * octile((start - start_y * width) - (field - y * width), start_y - y)
    return put(heap, place, keys, size, field, cost + ahead + passed, cost)


@njit(cache=True, nogil=True)
def note_changes(
    weights: Floats,
    width: int,
    g: Floats,
    rhs: Floats,
    heap: Fields,
    place: Fields,
    keys: Floats,
    size: int,
    changed: NDArray[np.int64],
    start: int,
    target: int,
    least: float,
    passed: float,
    corner_cutting: bool,
) -> int:
    """Ask again all fields that a step from may cost something else now: the changed ones and those round them."""
    for centre in changed:
        x, y = centre % width, centre // width
        for near_y in range(max(y - 1, 0), min(y + 2, len(weights) // width)):
            for near_x in range(max(x - 1, 0), min(x + 2, width)):
                field = near_y * width + near_x
                if field != target:
                    rhs[field] = cheapest_step(weights, width, g, field, corner_cutting)[1]
                size = queue(width, g, rhs, heap, place, keys, size, field, start, least, passed)
    return size


@njit(cache=True, nogil=True)
def settle(
    weights: Floats,
    width: int,
    g: Floats,
    rhs: Floats,
    heap: Fields,
    place: Fields,
    keys: Floats,
    size: int,
    start: int,
    target: int,
    least: float,
    passed: float,
    corner_cutting: bool,
    slack: float,
) -> int:
    """Take fields out of the queue until no waiting one can matter for the start (the paper's ComputeShortestPath); the queue's size.

    With a ``slack`` those are taken too that cost so much more than the start does.
    """
    while size > 0:
        here = heap[0]
        cost = min(g[start], rhs[start])
        if keys[here, 0] > cost + passed + slack and g[start] == rhs[start]:
            break
        if slack == 0.0 and g[start] == rhs[start] and keys[here, 0] == cost + passed and keys[here, 1] >= cost:
            break
        old_first, old_second = keys[here, 0], keys[here, 1]
        size = queue(width, g, rhs, heap, place, keys, size, here, start, least, passed)
        if keys[here, 0] > old_first or (keys[here, 0] == old_first and keys[here, 1] > old_second):
            continue  # it waits since the start was elsewhere, and its turn is later now
        cheaper = g[here] > rhs[here]
        gone = g[here]
        g[here] = rhs[here] if cheaper else np.inf
        if not cheaper and here != target:
            rhs[here] = cheapest_step(weights, width, g, here, corner_cutting)[1]
        size = queue(width, g, rhs, heap, place, keys, size, here, start, least, passed)
        y = here // width
        x = here - y * width
        for i in range(8):
            near, _, cost = step(weights, width, x, y, i, corner_cutting)
            if near < 0 or near == target:
                continue
            if cheaper:
                if rhs[near] <= cost + g[here]:
                    continue
                rhs[near] = cost + g[here]
            elif rhs[near] == cost + gone:
                rhs[near] = cheapest_step(weights, width, g, near, corner_cutting)[1]
            size = queue(width, g, rhs, heap, place, keys, size, near, start, least, passed)
    return size


@njit(cache=True, nogil=True)
def way_on(
    weights: Floats, width: int, g: Floats, rhs: Floats, start: int, target: int, corner_cutting: bool
) -> CellArray:
    """The fields of the cheapest way from start to target. No fields if one on it has not been settled."""
    fields = np.empty((len(weights), 2), np.int32)
    here, count = start, 0
    while True:
        if g[here] != rhs[here] or count == len(fields):
            return np.empty((0, 2), np.int64)
        fields[count, 0], fields[count, 1] = here % width, here // width
        count += 1
        if here == target:
            return fields[:count].astype(np.int64)
        here, _ = cheapest_step(weights, width, g, here, corner_cutting)
