"""The compiled part of D* Lite (Koenig & Likhachev 2002, the optimised version). It searches from the target.

Names are the paper's: ``g`` is the cost of a field to the target when it was last expanded, ``rhs`` the cost that its
neighbours give it now. A field waits in the queue exactly while the two differ. Fields are numbered row after row. A
step costs the same as in ``problem.path_cost``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE
from companion.planning.graph_search.heap import Queue, put, take_out
from companion.planning.graph_search.steps import STEP_X, STEP_Y, octile
from companion.planning.problem import MIN_WEIGHT
from companion.planning.raster import SQRT2, CellArray

Floats = NDArray[np.float64]


class Search(NamedTuple):
    """A search, kept between two plans.

    ``weights``, ``g`` and ``rhs``: shape (fields,). ``least``: the cost of the cheapest step, for the heuristic.
    ``passed`` (the paper's k_m): how far the start has moved since the search began, by the heuristic.
    """

    weights: Floats
    width: int
    corner_cutting: bool
    start: int
    target: int
    least: float
    passed: float
    g: Floats
    rhs: Floats
    queue: Queue


@njit(cache=True, nogil=True)
def changes(old: Floats, new: Floats, changed: NDArray[np.int64]) -> int:
    """Copy ``new`` to ``old`` and write the numbers of the fields that differ; returns how many do.

    If ``changed`` has too little room it returns its length + 1, and only a part has been copied.
    """
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
    """Step i from a field: where it leads, its cost, and the cost of the step back; -1 if it is not allowed."""
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
def cheapest_step(search: Search, here: int) -> tuple[int, float]:
    """The neighbour on the cheapest path to the target, and the cost of that path; -1 and inf if there is none."""
    weights, width, g, corner_cutting = search.weights, search.width, search.g, search.corner_cutting
    best, onward = np.inf, -1
    y = here // width
    x = here - y * width
    for i in range(8):
        to, cost, _ = step(weights, width, x, y, i, corner_cutting)
        if to >= 0 and cost + g[to] < best:
            best, onward = cost + g[to], to
    return onward, best


@njit(cache=True, nogil=True)
def update(search: Search, field: int) -> None:
    """Put the field into the queue with its present key if its two numbers differ; else take it out (UpdateVertex)."""
    g, rhs, width = search.g[field], search.rhs[field], search.width
    if g == rhs:
        take_out(search.queue, field)
        return
    cost = min(g, rhs)
    # A product is much faster than the remainder of a division.
    y, start_y = field // width, search.start // width
    ahead = search.least * octile((search.start - start_y * width) - (field - y * width), start_y - y)
    put(search.queue, field, cost + ahead + search.passed, cost)


@njit(cache=True, nogil=True)
def note_changes(search: Search, changed: NDArray[np.int64]) -> None:
    """Update all fields from which a step may have another cost now: the changed ones and their neighbours."""
    width, height = search.width, len(search.weights) // search.width
    for centre in changed:
        x, y = centre % width, centre // width
        for near_y in range(max(y - 1, 0), min(y + 2, height)):
            for near_x in range(max(x - 1, 0), min(x + 2, width)):
                field = near_y * width + near_x
                if field != search.target:
                    search.rhs[field] = cheapest_step(search, field)[1]
                update(search, field)


@njit(cache=True, nogil=True)
def settle(search: Search, slack: float) -> None:
    """Expand fields until no waiting one can change the cost of the start (the paper's ComputeShortestPath).

    With a ``slack`` fields that cost up to so much more than the start are expanded too.
    """
    weights, width, start, passed = search.weights, search.width, search.start, search.passed
    g, rhs, keys, heap = search.g, search.rhs, search.queue.keys, search.queue.heap
    while heap[0] > 0:
        here = heap[1]
        cost = min(g[start], rhs[start])
        if keys[here, 0] > cost + passed + slack and g[start] == rhs[start]:
            break
        if slack == 0.0 and g[start] == rhs[start] and keys[here, 0] == cost + passed and keys[here, 1] >= cost:
            break
        old_first, old_second = keys[here, 0], keys[here, 1]
        update(search, here)
        if keys[here, 0] > old_first or (keys[here, 0] == old_first and keys[here, 1] > old_second):
            continue  # its key was older than the last move of the start: its turn is later now
        cheaper = g[here] > rhs[here]
        gone = g[here]
        g[here] = rhs[here] if cheaper else np.inf
        if not cheaper and here != search.target:
            rhs[here] = cheapest_step(search, here)[1]
        update(search, here)
        y = here // width
        x = here - y * width
        for i in range(8):
            near, _, cost = step(weights, width, x, y, i, search.corner_cutting)
            if near < 0 or near == search.target:
                continue
            if cheaper:
                if rhs[near] <= cost + g[here]:
                    continue
                rhs[near] = cost + g[here]
            elif rhs[near] == cost + gone:
                rhs[near] = cheapest_step(search, near)[1]
            update(search, near)


@njit(cache=True, nogil=True)
def path_found(search: Search) -> CellArray:
    """The fields of the cheapest path from start to target; no rows if one of them is still waiting."""
    width, g, rhs = search.width, search.g, search.rhs
    fields = np.empty((len(g), 2), np.int32)
    here, count = search.start, 0
    while True:
        if g[here] != rhs[here] or count == len(fields):
            return np.empty((0, 2), np.int64)
        fields[count, 0], fields[count, 1] = here % width, here // width
        count += 1
        if here == search.target:
            return fields[:count].astype(np.int64)
        here, _ = cheapest_step(search, here)


@njit(cache=True, nogil=True)
def solve(search: Search, slack: float) -> CellArray:
    """Search on until the start's cost is known; the fields of the path, no rows if there is none.

    Rounding can make the order of expansion wrong, so that a field of the path is still waiting: then up to ``slack``
    more is expanded.
    """
    if search.queue.heap[0] == 0 and search.g[search.target] != search.rhs[search.target]:
        update(search, search.target)  # a new search
    for more in (0.0, slack):
        settle(search, more)
        if search.g[search.start] == np.inf:
            break
        cells = path_found(search)
        if len(cells) > 0:
            return cells
    return np.empty((0, 2), np.int64)
