"""A* where all free ground costs the same: of many equally short ways to a field only one is followed. Compiled.

On such ground most fields can be reached by many paths of one length, which differ only in the order of their steps. Of those only the canonical
ones are followed (Sturtevant & Rabin 2016; it is the pruning of Harabor & Grastien's jump points, 2011, without the jumps): diagonal steps
first, straight ones after. So from a field entered by a straight step the search goes straight on, and turns aside only where
the field diagonally behind it is an obstacle, because nobody could come from there; from a field entered by a diagonal step there are three ways on
instead of eight. Where several of these ways to a field are equally long each of them goes on, as each leaves out others.

Lengths are fixed-point numbers, so sums do not depend on their order, and equal ones are equal. Corners are not cut.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.grid import OBSTACLE
from companion.planning.astar_kernel import STEP_X, STEP_Y
from companion.planning.raster import CellArray

Floats = NDArray[np.float64]
Entries = NDArray[np.int32]
Reached = NDArray[np.int64]

UNIT = 1 << 30
"""The length of a straight step. A path of all fields of a large map fits beside the eight bits of directions."""
DIAGONAL = 1518500250
"""Of a diagonal one: sqrt 2 to nine digits."""
DIRECTIONS = 8
"""Bits of a field's number that tell by which steps it was entered; the higher ones are the length of the way to it."""
BUCKET_SHIFT = 26
BUCKETS = 64
"""A bucket is a sixteenth wide; a step adds at most twice sqrt 2 to the sum."""
NONE, FOUND, CROWDED = range(3)
NOT_YET = np.iinfo(np.int64).max


@njit(cache=True, nogil=True, inline="always")
def ahead(delta_x: int, delta_y: int) -> int:
    """The length of the shortest way over an empty map, as a fixed-point number."""
    across, along = abs(delta_x), abs(delta_y)
    return UNIT * max(across, along) + (DIAGONAL - UNIT) * min(across, along)


@njit(cache=True, nogil=True)
def is_uniform(fields: Floats, weight: float) -> bool:
    """Whether all fields that are not obstacles have this weight."""
    others = 0
    for i in range(len(fields)):  # no way out before the end: so it is vectorised, and six times as fast
        others |= (fields[i] != weight) & (fields[i] < OBSTACLE)
    return others == 0


@njit(cache=True, nogil=True)
def shortest_uniform(
    weights: Floats, reached: Reached, room: int, start_x: int, start_y: int, target_x: int, target_y: int
) -> CellArray:
    """The fields of a shortest path between two free ones; none if there is no path.

    ``reached``: zeros, one for each field. ``room``: of the queue, to begin with, at least 8; if it turns out too small, all begins again with more.
    """
    found = _search(weights, reached, room, start_x, start_y, target_x, target_y)
    while found == CROWDED:
        room *= 2
        reached[:] = 0
        found = _search(weights, reached, room, start_x, start_y, target_x, target_y)
    if found == NONE:
        return np.empty((0, 2), np.int64)
    width = weights.shape[1]
    return _way_back(reached, width, start_y * width + start_x, target_x, target_y)


@njit(cache=True, nogil=True)
def straight_on(
    fields: Floats, reached: Reached, width: int, x: int, y: int, target_x: int, target_y: int, way: int
) -> int:
    """From a field entered by a straight step as far on as each step leads nearer to the target; how many steps.

    It ends before the target, the map's edge, an obstacle, a field that was reached as well, and where a way aside begins.
    """
    step_x, step_y = STEP_X[way], STEP_Y[way]
    along = (target_x - x) * step_x + (target_y - y) * step_y
    across = abs((target_x - x) * step_y) + abs((target_y - y) * step_x)
    hop, aside, height = step_y * width + step_x, step_x * width + step_y, len(fields) // width
    # The fields beside it; where the map ends there, the run itself stands in for them.
    one = aside if 0 <= x + step_y < width and 0 <= y + step_x < height else 0
    other = -aside if 0 <= x - step_y < width and 0 <= y - step_x < height else 0
    field, bit = y * width + x, 1 << way
    length = reached[field] >> DIRECTIONS
    for steps in range(along - max(across, 1)):
        if max(fields[field - hop + one], fields[field - hop + other], fields[field + hop]) >= OBSTACLE:
            return steps
        field += hop
        length += UNIT
        before = reached[field]
        if before == 0 or before >> DIRECTIONS > length:
            reached[field] = length << DIRECTIONS | bit
        elif before >> DIRECTIONS == length and before & bit == 0:
            reached[field] = before | bit
        else:
            return steps
    return max(along - max(across, 1), 0)


@njit(cache=True, nogil=True)
def ways_on(onward: Entries, fields: Floats, width: int, x: int, y: int, way: int) -> int:
    """Write the steps that may be canonical from a field entered by this step (8: the start), and how many."""
    if way >= 8:
        for i in range(8):
            onward[i] = i
        return 8
    onward[0] = way & 3
    if way >= 4:
        onward[1], onward[2] = (way + 1) & 3, way
        return 3
    count, height = 1, len(fields) // width
    back_x, back_y, right = x - STEP_X[way], y - STEP_Y[way], (way + 3) & 3
    for aside, between in (((way + 1) & 3, 4 + way), (right, 4 + right)):
        side_x, side_y = STEP_X[aside], STEP_Y[aside]
        if not (0 <= x + side_x < width and 0 <= y + side_y < height):
            continue
        if fields[(back_y + side_y) * width + back_x + side_x] >= OBSTACLE:
            onward[count], onward[count + 1] = aside, between
            count += 2
    return count


@njit(cache=True, nogil=True)
def _search(  # noqa: PLR0912, PLR0915 - one loop, as in ``astar_kernel.search``
    weights: Floats, reached: Reached, room: int, start_x: int, start_y: int, target_x: int, target_y: int
) -> int:
    """Whether there is a way; CROWDED if the queue would need more than its room. ``reached``: zeros, one for each field."""
    height, width = weights.shape
    fields = weights.ravel()
    target = target_y * width + target_x
    heads, entries = np.full(BUCKETS, -1, np.int32), np.empty((room, 4), np.int32)
    onward = np.empty(8, np.int32)
    reached[start_y * width + start_x] = (1 << DIRECTIONS) - 1
    if start_x == target_x and start_y == target_y:
        return FOUND
    best, free, unused, waiting = NOT_YET, -1, 0, 0
    bucket = ahead(target_x - start_x, target_y - start_y) >> BUCKET_SHIFT
    last = NOT_YET
    x, y, way = start_x, start_y, 8
    while True:
        if way < 4:
            steps = straight_on(fields, reached, width, x, y, target_x, target_y, way)
            x, y = x + steps * STEP_X[way], y + steps * STEP_Y[way]
        so_far = reached[y * width + x] >> DIRECTIONS
        inside = 0 < x < width - 1 and 0 < y < height - 1
        count = ways_on(onward, fields, width, x, y, way)
        held = -1
        for k in range(count):
            i = onward[k]
            to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
            if not inside and not (0 <= to_x < width and 0 <= to_y < height):
                continue
            to = to_y * width + to_x
            if fields[to] >= OBSTACLE:
                continue
            if i >= 4 and max(fields[y * width + to_x], fields[to_y * width + x]) >= OBSTACLE:
                continue
            cost = so_far + (UNIT if i < 4 else DIAGONAL)
            before, bit = reached[to], 1 << i
            known = before >> DIRECTIONS
            if before != 0 and (known < cost or (known == cost and before & bit != 0)):
                continue
            total = cost + ahead(target_x - to_x, target_y - to_y)
            if total >= best:
                continue
            reached[to] = before | bit if before != 0 and known == cost else cost << DIRECTIONS | bit
            if to == target:
                best, last = cost, cost >> BUCKET_SHIFT
                continue
            into = total >> BUCKET_SHIFT
            if into == bucket and held < 0:
                held = i
                continue
            if free >= 0:
                new, free = free, entries[free, 3]
            else:
                new, unused = unused, unused + 1
            slot = into & (BUCKETS - 1)
            entries[new, 0], entries[new, 1], entries[new, 2] = to_x, to_y, i
            entries[new, 3], heads[slot] = heads[slot], new
            waiting += 1
        if waiting + 8 > room:
            return CROWDED
        if held >= 0:
            x, y, way = x + STEP_X[held], y + STEP_Y[held], held
            continue
        while True:
            if waiting == 0 or bucket > last:
                return FOUND if best < NOT_YET else NONE
            entry = heads[bucket & (BUCKETS - 1)]
            if entry < 0:
                bucket += 1
                continue
            heads[bucket & (BUCKETS - 1)], entries[entry, 3], free = entries[entry, 3], free, entry
            waiting -= 1
            x, y, way = entries[entry, 0], entries[entry, 1], entries[entry, 2]
            if reached[y * width + x] >> way & 1:
                break


@njit(cache=True, nogil=True)
def _way_back(reached: Reached, width: int, start: int, target_x: int, target_y: int) -> CellArray:
    """Walk back from the target to the start; fields in the order of the path. Straight on wherever that is as short."""
    count, x, y, way = 1, target_x, target_y, 0
    while y * width + x != start:
        way = _entered(reached[y * width + x], way)
        x, y, count = x - STEP_X[way], y - STEP_Y[way], count + 1
    cells = np.empty((count, 2), np.int64)
    x, y, way = target_x, target_y, 0
    for at in range(count - 1, 0, -1):
        cells[at, 0], cells[at, 1] = x, y
        way = _entered(reached[y * width + x], way)
        x, y = x - STEP_X[way], y - STEP_Y[way]
    cells[0, 0], cells[0, 1] = x, y
    return cells


@njit(cache=True, nogil=True, inline="always")
def _entered(number: int, way: int) -> int:
    """By which step a field was entered: this one if possible."""
    while not number >> way & 1:
        way = (way + 1) & 7
    return way
