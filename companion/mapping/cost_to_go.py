"""Cost-to-go: the time that is left from each cell of a raster to a goal, by fast marching.

Sethian 1996, "A fast marching level set method": cells are taken in the order of their times, each computed from the
earlier ones of its four neighbours, so that the front is round and not a diamond.

Nouns: cost-to-go.
"""

# mypy: disable-error-code="no-untyped-def"

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def cost_to_go(pace, goals):
    """Times, shape as ``pace``: seconds that a cell takes to cross, inf where nobody may be; inf where no way leads.

    ``goals``: shape (n, 2), x and y of the cells from which the front starts.
    """
    height, width = pace.shape
    times = np.full((height, width), np.inf)
    done = np.zeros((height, width), np.bool_)
    heap = np.empty(4 * height * width + goals.shape[0] + 1, np.float64)
    cells = np.empty(heap.size, np.int64)
    count = 0
    for goal in range(goals.shape[0]):
        x, y = goals[goal, 0], goals[goal, 1]
        if 0 <= x < width and 0 <= y < height and times[y, x] > 0.0:
            times[y, x] = 0.0
            count = _push(heap, cells, count, 0.0, y * width + x)
    while count > 0:
        cell = cells[0]
        count = _pop(heap, cells, count)
        y, x = cell // width, cell % width
        if done[y, x]:
            continue
        done[y, x] = True
        for side in range(4):
            nx = x + (1 if side == 0 else -1 if side == 1 else 0)
            ny = y + (1 if side == 2 else -1 if side == 3 else 0)
            if not (0 <= nx < width and 0 <= ny < height) or done[ny, nx] or math.isinf(pace[ny, nx]):
                continue
            time = _arrival(times, pace[ny, nx], nx, ny)
            if time < times[ny, nx]:
                times[ny, nx] = time
                count = _push(heap, cells, count, time, ny * width + nx)
    return times


@njit(cache=True, nogil=True)
def _arrival(times, pace, x, y):
    """When a front arrives that has passed some of the neighbours: upwind, from one of each axis."""
    height, width = times.shape
    east = min(times[y, x - 1] if x > 0 else np.inf, times[y, x + 1] if x + 1 < width else np.inf)
    north = min(times[y - 1, x] if y > 0 else np.inf, times[y + 1, x] if y + 1 < height else np.inf)
    first, second = min(east, north), max(east, north)
    if second - first >= pace:
        return first + pace
    return 0.5 * (first + second + math.sqrt(2.0 * pace * pace - (second - first) ** 2))


@njit(cache=True, nogil=True)
def _push(heap, cells, count, time, cell):
    at = count
    while at > 0:
        above = (at - 1) // 2
        if heap[above] <= time:
            break
        heap[at], cells[at] = heap[above], cells[above]
        at = above
    heap[at], cells[at] = time, cell
    return count + 1


@njit(cache=True, nogil=True)
def _pop(heap, cells, count):
    """Take the first one out; gives how many are left."""
    count -= 1
    time, cell = heap[count], cells[count]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= count:
            break
        if below + 1 < count and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= time:
            break
        heap[at], cells[at] = heap[below], cells[below]
        at = below
    heap[at], cells[at] = time, cell
    return count
