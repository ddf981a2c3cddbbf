"""The compiled part of A*.

Fields are numbered row after row. One number a field holds all that is known of it: 0, not reached; positive, the cost of reaching it,
and it waits in the queue; negative, minus the cost, and it has been taken. So the memory of a search is zeros to begin with, and only
the part of the map that is searched is ever touched.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.grid import OBSTACLE
from companion.planning.problem import MIN_WEIGHT
from companion.planning.raster import SQRT2, CellArray

Floats = NDArray[np.float64]
Entries = NDArray[np.int32]

STEP_X = (1, 0, -1, 0, 1, -1, -1, 1)
STEP_Y = (0, 1, 0, -1, 1, 1, -1, -1)
"""The eight steps, straight ones first."""
START_COST = 1e-300
"""What the start costs: not 0, which means not reached, but lost in any sum."""
ROUNDING = 1.0 - 1e-12
"""Sums that differ by less are taken for equal."""
BUCKETS = 1024
"""A power of two. They hold what one step can add to the sum: at most sqrt 2, and as much again if it leads away."""


@njit(cache=True, nogil=True, fastmath=True)
def least_weight(weights: Floats) -> float:
    """The least that any field costs to enter, at least MIN_WEIGHT."""
    least = OBSTACLE
    for i in range(len(weights)):
        least = weights[i] if weights[i] < least else least  # min() would not be vectorised
    return max(least, MIN_WEIGHT)


@njit(cache=True, nogil=True, inline="always")
def octile(delta_x: int, delta_y: int) -> float:
    """The length of the shortest way over an empty map."""
    across, along = abs(delta_x), abs(delta_y)
    return max(across, along) + (SQRT2 - 1.0) * min(across, along)


@njit(cache=True, nogil=True)
def swept(
    entries: Entries, heads: Entries, reached: Floats, width: int, target_x: int, target_y: int, least: float
) -> tuple[int, int]:
    """Throw entries out of the queue that are worthless; the first free entry, and how many stay: at most two a field."""
    free, waiting = -1, 0
    per_cost = per_bucket(least)
    for slot in range(len(heads)):
        entry, heads[slot] = heads[slot], -1
        while entry >= 0:
            after = entries[entry, 2]
            x, y = entries[entry, 0], entries[entry, 1]
            cost = reached[y * width + x]
            total = cost + least * octile(target_x - x, target_y - y)
            # Rounding may have put it one bucket later.
            if cost > 0.0 and (slot - int(total * per_cost)) & (BUCKETS - 1) <= 1:
                entries[entry, 2], heads[slot] = heads[slot], entry
                waiting += 1
            else:
                entries[entry, 2], free = free, entry
            entry = after
    return free, waiting


@njit(cache=True, nogil=True, inline="always")
def per_bucket(least: float) -> float:
    """Buckets for a cost of 1."""
    return min((BUCKETS - 2) / (2.0 * SQRT2), 16.0 / least)


@njit(cache=True, nogil=True)
def step_cost(weights: Floats, x: int, y: int, i: int, corner_cutting: bool) -> float:
    """The cost of step i from this field; inf if it is not allowed."""
    height, width = weights.shape
    to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
    if not (0 <= to_x < width and 0 <= to_y < height) or weights[to_y, to_x] >= OBSTACLE:
        return np.inf
    if i < 4:
        return float(max(weights[to_y, to_x], MIN_WEIGHT))
    if not corner_cutting and max(weights[y, to_x], weights[to_y, x]) >= OBSTACLE:
        return np.inf
    return float(max(weights[to_y, to_x], MIN_WEIGHT) * SQRT2)


@njit(cache=True, nogil=True)
def search(  # noqa: PLR0912, PLR0915 - one loop: a call with arrays for every neighbour takes four times as long
    weights: Floats, reached: Floats, start_x: int, start_y: int, target_x: int, target_y: int, corner_cutting: bool
) -> bool:
    """Fill ``reached`` until the target's cost is known to be the least. Whether there is a way. Both ends are free."""
    height, width = weights.shape
    fields = weights.ravel()
    target = target_y * width + target_x
    reached[start_y * width + start_x] = START_COST
    if start_x == target_x and start_y == target_y:
        return True
    least = least_weight(fields)
    per_cost, mask = per_bucket(least), BUCKETS - 1
    heads, entries = np.full(BUCKETS, -1, np.int32), np.empty((3 * weights.size + 16, 3), np.int32)
    entries[0, 0], entries[0, 1], entries[0, 2] = start_x, start_y, -1
    free, unused, waiting, best = -1, 1, 1, np.inf
    bucket = int(least * octile(target_x - start_x, target_y - start_y) * per_cost)
    heads[bucket & mask] = 0
    while waiting > 0 and bucket <= best * per_cost:
        entry = heads[bucket & mask]
        if entry < 0:
            bucket += 1
            continue
        heads[bucket & mask], entries[entry, 2], free = entries[entry, 2], free, entry
        waiting -= 1
        x, y = entries[entry, 0], entries[entry, 1]
        so_far = reached[y * width + x]
        if so_far < 0.0:
            continue
        reached[y * width + x] = -so_far
        if waiting + 8 > len(entries):
            free, waiting = swept(entries, heads, reached, width, target_x, target_y, least)
        inside = 0 < x < width - 1 and 0 < y < height - 1
        for i in range(8):
            to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
            if not inside and not (0 <= to_x < width and 0 <= to_y < height):
                continue
            field = to_y * width + to_x
            weight, before = fields[field], reached[field]
            cost = so_far + max(weight, MIN_WEIGHT) * (1.0 if i < 4 else SQRT2)
            if weight >= OBSTACLE or (before != 0.0 and abs(before) <= cost):
                continue
            if i >= 4 and not corner_cutting and max(fields[y * width + to_x], fields[to_y * width + x]) >= OBSTACLE:
                continue
            ahead = least * octile(target_x - to_x, target_y - to_y)
            if cost + ahead >= best * ROUNDING:
                continue
            reached[field] = cost
            if field == target:
                best = cost
            into = int((cost + ahead) * per_cost)
            if field == target or (before > 0.0 and int((before + ahead) * per_cost) == into):
                continue
            # Rounding may make a sum a hair less than that of the field it came from.
            slot = max(into, bucket) & mask
            if free >= 0:
                new, free = free, entries[free, 2]
            else:
                new, unused = unused, unused + 1
            entries[new, 0], entries[new, 1] = to_x, to_y
            entries[new, 2], heads[slot] = heads[slot], new
            waiting += 1
    return bool(best < np.inf)


@njit(cache=True, nogil=True)
def way_back(
    weights: Floats, reached: Floats, width: int, target_x: int, target_y: int, corner_cutting: bool
) -> CellArray:
    """Walk back from the target to the start; fields in the order of the path.

    Of equally short ways back the one straight on is taken: fewer bends for the rover.
    """
    height = len(weights) // width
    fields = np.empty((len(weights), 2), np.int32)
    x, y, count, straight_on = target_x, target_y, 0, 0
    while abs(reached[y * width + x]) > START_COST:
        fields[count, 0], fields[count, 1] = x, y
        count += 1
        enter = max(weights[y * width + x], MIN_WEIGHT)
        nearest, best = -1, np.inf
        for turn in range(8):
            i = (straight_on + turn) & 7
            from_x, from_y = x + STEP_X[i], y + STEP_Y[i]
            if not (0 <= from_x < width and 0 <= from_y < height) or reached[from_y * width + from_x] == 0.0:
                continue
            cost = abs(reached[from_y * width + from_x]) + enter * (1.0 if i < 4 else SQRT2)
            if not cost < best - 1e-9 * enter:
                continue
            if i < 4 or corner_cutting or max(weights[y * width + from_x], weights[from_y * width + x]) < OBSTACLE:
                nearest, best = i, cost
        straight_on = nearest
        x += STEP_X[nearest]
        y += STEP_Y[nearest]
    fields[count, 0], fields[count, 1] = x, y
    return fields[count::-1].astype(np.int64)
