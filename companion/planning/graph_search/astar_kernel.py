"""The compiled part of A*, which follows only few of the equally cheap paths to a field.

On even ground most fields can be reached by many paths of the same cost that differ only in the order of their steps.
Only the canonical ones are followed (Sturtevant & Rabin 2016; the pruning of jump point search, Harabor & Grastien
2011, without the jumps): diagonal steps first, straight ones after. From a field entered by a straight step the search
goes straight on. It turns only where an obstacle, or ground of another cost, makes a turn more than another order of
the same steps. From a field entered by a diagonal step there are three successors instead of eight. Where several paths
to a field are equally cheap each of them is continued, because each leaves out others. The rules compare the weights of
the three or four fields concerned, so they hold on any ground.

Costs are fixed-point numbers, so sums do not depend on their order and equal costs are equal. One number for each field
holds all that the search knows of it: 0 if it is not reached, else its cost and, in the lowest bits, the steps by which
it was entered. So the memory of a search begins as zeros, and only the part of the map that is searched is ever
touched.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE
from companion.planning.graph_search.steps import STEP_X, STEP_Y, Query, least_cost
from companion.planning.problem import MIN_WEIGHT
from companion.planning.raster import SQRT2, CellArray

Floats = NDArray[np.float64]
Entries = NDArray[np.int32]
Reached = NDArray[np.int64]
U = np.uint64  # as an index: else the compiler adds a test for negative ones

UNIT = 1 << 30
"""Cost 1 in fixed point. The cost of a path through all fields of a large map fits beside the bits of the steps."""
DIRECTIONS = 8
"""Bits of a field's number for the steps by which it was entered."""
ANY_WAY = 8
"""Numbers from here on are no step: the start was not entered by one."""
BUCKETS = 1024
"""A power of two. Enough for what one step can add to the sum: at most sqrt 2, and as much again if it leads away."""
RUN = 8
"""How many fields a search goes straight on ahead of its queue. With many more it sometimes has much to correct."""
LEAST_SHIFT = 22
"""The least number of bits of the sum that are dropped for the bucket's number."""
NONE, FOUND, CROWDED = range(3)
NOT_YET = np.iinfo(np.int64).max


@njit(cache=True, nogil=True, inline="always")
def step_costs(weight: float) -> tuple[int, int]:
    """The cost of a straight and of a diagonal step onto a field of this weight, in fixed point."""
    cost = max(weight, MIN_WEIGHT) * UNIT
    return int(cost), int(cost * SQRT2)


@njit(cache=True, nogil=True, inline="always")
def ahead(straight: int, diagonal: int, delta_x: int, delta_y: int) -> int:
    """The heuristic: the cost of the shortest path over ground where steps cost so much."""
    across, along = abs(delta_x), abs(delta_y)
    return straight * max(across, along) + (diagonal - straight) * min(across, along)


@njit(cache=True, nogil=True)
def shortest(weights: Floats, reached: Reached, room: int, query: Query) -> CellArray:
    """The fields of a cheapest path between two free ones; no rows if there is no path.

    ``reached``: zeros, one for each field. ``room``: entries of the queue to begin with, at least 8. If they are too
    few, the search begins again with more.
    """
    least = least_cost(weights.ravel(), weights[query.target_y, query.target_x])
    found = _search(weights, reached, room, least, query)
    while found == CROWDED:
        room *= 2
        reached[:] = 0
        found = _search(weights, reached, room, least, query)
    if found == NONE:
        return np.empty((0, 2), np.int64)
    return _trace_back(weights, reached, query)


@njit(cache=True, nogil=True, inline="always")
def is_pruned(behind: float, beside: float, between: float, here: float) -> bool:
    """Whether the steps to one side can be left out when the search goes straight on from here.

    The weights are those of the fields diagonally behind on that side, beside, and diagonally ahead. The fields can be
    reached as cheaply by a diagonal step from the field before this one, or they cannot be entered from here either.
    """
    even = beside == here and (between == here or between >= OBSTACLE)
    return bool(beside >= OBSTACLE or (behind < OBSTACLE and even))


@njit(cache=True, nogil=True, forceinline=True)
def straight_on(
    fields: Floats, reached: Reached, width: int, x: int, y: int, way: int, query: Query, least: float
) -> int:
    """Go straight on from a field entered by straight step ``way`` while no other step is canonical; how many steps.

    It ends before the target, the map's edge, an obstacle, ground of another cost, and a field that was reached as
    cheaply. As long as the sum of cost and heuristic stays the same, this is what the queue would do next. Beyond that
    it runs ahead of the queue, but not far: handling single fields in the queue takes much longer than a few unneeded
    fields.
    """
    target_x, target_y = query.target_x, query.target_y
    step_x, step_y, height = STEP_X[way], STEP_Y[way], len(fields) // width
    along = (target_x - x) * step_x + (target_y - y) * step_y
    across = abs((target_x - x) * step_y) + abs((target_y - y) * step_x)
    edge = (width - 1 - x if step_x > 0 else x) if step_x != 0 else height - 1 - y if step_y > 0 else y
    most = min(edge, RUN)
    if along > 0:
        most = max(most, along - across) if across > 0 and fields[y * width + x] <= least else most
        most = along - 1 if across == 0 else most
    if most <= 0:
        return 0
    # The rows beside the run; at the edge of the map the run itself is used instead.
    hop, aside = step_y * width + step_x, step_x * width + step_y
    one = aside if 0 <= x + step_y < width and 0 <= y + step_x < height else 0
    other = -aside if 0 <= x - step_y < width and 0 <= y - step_x < height else 0
    field, bit = y * width + x, 1 << way
    here, cost = fields[field], reached[field] >> DIRECTIONS
    straight, _ = step_costs(here)
    if fields[field - hop + one] >= OBSTACLE or fields[field - hop + other] >= OBSTACLE:
        return 0
    if fields[field + one] != here or fields[field + other] != here:
        return 0
    for steps in range(most):
        field += hop
        if fields[U(field)] != here or fields[U(field + one)] != here or fields[U(field + other)] != here:
            return steps
        cost += straight
        before = reached[U(field)]
        if before == 0 or before >> DIRECTIONS > cost:
            reached[U(field)] = cost << DIRECTIONS | bit
        elif before >> DIRECTIONS == cost and before & bit == 0:
            reached[U(field)] = before | bit
        else:
            return steps
    return most


@njit(cache=True, nogil=True, forceinline=True)
def ways_on(onward: Entries, fields: Floats, width: int, x: int, y: int, way: int) -> int:
    """Write the steps that may be canonical from a field entered by this step, allowed or not. Returns how many."""
    if way >= ANY_WAY:
        for i in range(8):
            onward[i] = i
        return 8
    height, field, left, right = len(fields) // width, y * width + x, (way + 1) & 3, (way + 3) & 3
    here, hop = fields[field], STEP_Y[way & 3] * width + STEP_X[way & 3]
    onward[0] = way & 3
    if way >= 4:
        onward[1], onward[2], count = left, way, 3
        # Round a costly field two diagonal steps may be cheaper than the two straight ones over it.
        if fields[field - hop] > here:
            onward[count], count = 4 + left, count + 1
        if fields[field - STEP_Y[left] * width - STEP_X[left]] > here:
            onward[count], count = 4 + right, count + 1
        return count
    count = 1
    ends = not (0 <= x + STEP_X[way] < width and 0 <= y + STEP_Y[way] < height)
    for aside, slanting in ((left, 4 + way), (right, 4 + right)):
        beside_x, beside_y = x + STEP_X[aside], y + STEP_Y[aside]
        if not (0 <= beside_x < width and 0 <= beside_y < height):
            continue
        beside = beside_y * width + beside_x
        between = OBSTACLE if ends else fields[beside + hop]
        if not is_pruned(fields[beside - hop], fields[beside], between, here):
            onward[count], onward[count + 1] = aside, slanting
            count += 2
    return count


@njit(cache=True, nogil=True)
def _search(  # noqa: PLR0912, PLR0915 - one loop: a call with arrays for every neighbour takes four times as long
    weights: Floats, reached: Reached, room: int, least: float, query: Query
) -> int:
    """FOUND or NONE; CROWDED if the queue would need more than its room."""
    start_x, start_y, target_x, target_y, corner_cutting = query
    height, width = weights.shape
    fields = weights.ravel()
    target = target_y * width + target_x
    straight, diagonal = step_costs(least)
    shift = max(int(math.log2(straight)) - 4, LEAST_SHIFT)
    heads, entries = np.full(BUCKETS, -1, np.int32), np.empty((room, 4), np.int32)
    onward = np.empty(8, np.int32)
    reached[start_y * width + start_x] = (1 << DIRECTIONS) - 1
    if start_x == target_x and start_y == target_y:
        return FOUND
    # If corners may be cut nothing is left out, and the sides of a diagonal step are not checked.
    loose, slanting = (ANY_WAY, 8) if corner_cutting else (0, 4)
    best, free, unused, waiting = NOT_YET, -1, 0, 0
    bucket = ahead(straight, diagonal, target_x - start_x, target_y - start_y) >> shift
    last = NOT_YET
    x, y, way = start_x, start_y, ANY_WAY
    while True:
        way |= loose
        if way < 4:
            steps = straight_on(fields, reached, width, x, y, way, query, least)
            x, y = x + steps * STEP_X[way], y + steps * STEP_Y[way]
        so_far = reached[y * width + x] >> DIRECTIONS
        inside = 0 < x < width - 1 and 0 < y < height - 1
        count, held = ways_on(onward, fields, width, x, y, way), -1
        for k in range(count):
            i = onward[k]
            to_x, to_y = x + STEP_X[i], y + STEP_Y[i]
            if not inside and not (0 <= to_x < width and 0 <= to_y < height):
                continue
            to = to_y * width + to_x
            weight = fields[U(to)]
            if weight >= OBSTACLE:
                continue
            if i >= slanting and max(fields[U(y * width + to_x)], fields[U(to_y * width + x)]) >= OBSTACLE:
                continue
            cost = so_far + step_costs(weight)[0 if i < 4 else 1]
            before, bit = reached[U(to)], 1 << i
            known = before >> DIRECTIONS
            if before != 0 and (known < cost or (known == cost and before & bit != 0)):
                continue
            total = cost + ahead(straight, diagonal, target_x - to_x, target_y - to_y)
            if total >= best:
                continue
            reached[U(to)] = before | bit if before != 0 and known == cost else cost << DIRECTIONS | bit
            if to == target:
                best, last = cost, cost >> shift
                continue
            into = total >> shift
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
def _trace_back(weights: Floats, reached: Reached, query: Query) -> CellArray:
    """Go back from the target to the start; the fields in the order of the path.

    Of equally cheap predecessors, canonical or not, the one straight on is taken: fewer bends for the rover.
    """
    target_x, target_y, corner_cutting = query.target_x, query.target_y, query.corner_cutting
    height, width = weights.shape
    fields = weights.ravel()
    cells = np.empty((weights.size, 2), np.int64)
    x, y, at, back = target_x, target_y, len(cells), 0
    while True:
        at -= 1
        cells[at, 0], cells[at, 1] = x, y
        field = y * width + x
        cost = reached[U(field)] >> DIRECTIONS
        if cost == 0:
            return cells[at:].copy()
        straight, diagonal = step_costs(fields[U(field)])
        while True:
            from_x, from_y = x + STEP_X[back], y + STEP_Y[back]
            if 0 <= from_x < width and 0 <= from_y < height:
                before = reached[U(from_y * width + from_x)]
                is_free = back < 4 or corner_cutting
                is_free = is_free or max(fields[U(y * width + from_x)], fields[U(from_y * width + x)]) < OBSTACLE
                if before != 0 and (before >> DIRECTIONS) + (straight if back < 4 else diagonal) == cost and is_free:
                    break
            back = (back + 1) & 7
        x, y = from_x, from_y
