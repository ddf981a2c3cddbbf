"""Compiled Hybrid A* (Dolgov et al. 2010): a short way of arcs, forwards and backwards, to a place on the path.

The states searched are the poses that arcs really lead to, one kept for each small square and heading. The length
still to go is estimated by a flood round the obstacles that ignores headings. Lengths are in evidence cells, see
``arc_kernels``.

Nouns: hybrid A*.
"""

from __future__ import annotations

import heapq
import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.mapping.arc_kernels import BLOCKED, UNSEEN, is_tail_unseen, is_unseen, place

HEADINGS = 36
"""So many headings are told apart."""
SHARES = (0.0, -0.5, 0.5, -1.0, 1.0)
"""Curvatures tried, as shares of the sharpest."""
UNSEEN_COST, BACK_COST = 1.5, 1.6
"""Cost of a metre forwards over unseen ground, and of a metre backwards, in metres forwards over seen ground."""
GREED = 1.2
"""Weight of the estimate against the cost so far: the way found is not quite the shortest, and is found much sooner."""
SQRT2 = math.sqrt(2.0)
AROUND = 0.3
"""Half the side of a square in cells. Backwards, all cells that the square touches round each place of an arc must have
been seen. The places looked at are half a cell apart or less, so no cell that the arc cuts is left out."""

Poses = NDArray[np.float64]
"""Shape (n, 4): x, y, heading, and 1 forwards or -1 backwards: how the rover gets there."""


class GoalRegion(NamedTuple):
    """Where the search is to lead.

    ``heading``: of the path there. The rover ends within ``heading_tolerance`` of it, or of the opposite at
    ``turned_cost`` more (it then goes on backwards). A tolerance of pi allows any.
    """

    x: float
    y: float
    heading: float
    tolerance: float
    heading_tolerance: float
    turned_cost: float


class ArcLimits(NamedTuple):
    """The arcs that the rover can drive, and how far to search.

    ``sharpest``: greatest curvature. ``step``: length of an arc. ``window``: half side of the square searched.
    ``bin``: side of a small square. ``room``: kept clear round the middle. ``tail``: so far from the middle the rim
    must be on seen ground where the rover goes backwards. ``first_way``: 1 or -1 if the way must begin forwards or
    backwards, else 0. ``expansions``: at most so many poses are expanded.
    """

    sharpest: float
    step: float
    window: int
    bin: int
    room: float
    tail: float
    switch_cost: float
    first_way: int
    expansions: int


@njit(cache=True, nogil=True)
def _state(ground: Any, known: Any, left: int, low: int, x: float, y: float, room: float) -> int:
    """``place`` of the middle of the evidence cell, worked out once a cell; outside the window all is BLOCKED."""
    cx, cy = int(math.floor(x)) - left, int(math.floor(y)) - low
    if not (0 <= cx < known.shape[1] and 0 <= cy < known.shape[0]):
        return BLOCKED
    if known[cy, cx] < 0:
        known[cy, cx] = place(ground, cx + left + 0.5, cy + low + 0.5, room)
    return int(known[cy, cx])


@njit(cache=True, nogil=True)
def _flood(ground: Any, known: Any, left: int, low: int, goal: Any, limits: Any) -> Any:
    """Shape (bins, bins): length of the shortest free way from each small square to the goal's; inf for none."""
    count = known.shape[0] // limits.bin
    to_go = np.full((count, count), np.inf)
    x, y = int(goal.x - left) // limits.bin, int(goal.y - low) // limits.bin
    if not (0 <= x < count and 0 <= y < count):
        return to_go
    to_go[y, x] = 0.0
    queue = [(0.0, y * count + x)]
    while queue:
        length, here = heapq.heappop(queue)
        y, x = here // count, here % count
        if length > to_go[y, x]:
            continue
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                nx, ny = x + dx, y + dy
                if (dx == 0 and dy == 0) or not (0 <= nx < count and 0 <= ny < count):
                    continue
                there = length + (SQRT2 if dx != 0 and dy != 0 else 1.0) * limits.bin
                if there >= to_go[ny, nx]:
                    continue
                middle_x, middle_y = left + (nx + 0.5) * limits.bin, low + (ny + 0.5) * limits.bin
                if _state(ground, known, left, low, middle_x, middle_y, limits.room) == BLOCKED:
                    continue
                to_go[ny, nx] = there
                heapq.heappush(queue, (there, ny * count + nx))
    return to_go


@njit(cache=True, nogil=True)
def _arrival(goal: Any, x: float, y: float, heading: float) -> float:
    """What it costs to end here; inf: this is not the end."""
    if math.hypot(x - goal.x, y - goal.y) > goal.tolerance:
        return math.inf
    aside = abs((heading - goal.heading + math.pi) % (2.0 * math.pi) - math.pi)
    if aside <= goal.heading_tolerance:
        return 0.0
    return float(goal.turned_cost) if math.pi - aside <= goal.heading_tolerance else math.inf


@njit(cache=True, nogil=True)
def _turn_cost(goal: Any, heading: float, sharpest: float) -> float:
    """The least that turning to the heading of the goal costs, on free ground."""
    aside = abs((heading - goal.heading + math.pi) % (2.0 * math.pi) - math.pi)
    straight = max(aside - goal.heading_tolerance, 0.0) / sharpest
    turned = max(math.pi - aside - goal.heading_tolerance, 0.0) / sharpest + goal.turned_cost
    return float(min(straight, turned))


@njit(cache=True, nogil=True)
def _unseen_around(ground: Any, x: float, y: float) -> bool:
    """Whether a cell that the square round a place touches has not been seen."""
    return (
        is_unseen(ground, x - AROUND, y - AROUND)
        or is_unseen(ground, x - AROUND, y + AROUND)
        or is_unseen(ground, x + AROUND, y - AROUND)
        or is_unseen(ground, x + AROUND, y + AROUND)
    )


@njit(cache=True, nogil=True)
def _arc_cost(
    ground: Any, known: Any, left: int, low: int, pose: Any, curvature: float, way: float, limits: Any
) -> tuple[float, float, float, float]:
    """Where a step on an arc leads (x, y, heading), and what it costs; inf where it cannot be driven."""
    x, y, heading = pose[0], pose[1], pose[2]
    pieces = max(2, int(math.ceil(limits.step)))
    piece = way * limits.step / pieces
    cost = 0.0
    for _ in range(pieces):
        middle = heading + 0.5 * curvature * piece
        dx, dy = piece * math.sin(middle), piece * math.cos(middle)
        if way < 0.0 and (_unseen_around(ground, x + 0.5 * dx, y + 0.5 * dy) or _unseen_around(ground, x + dx, y + dy)):
            return x, y, heading, math.inf
        x, y, heading = x + dx, y + dy, heading + curvature * piece
        if way < 0.0 and is_tail_unseen(ground, x, y, heading + math.pi, limits.tail):
            return x, y, heading, math.inf
        state = _state(ground, known, left, low, x, y, limits.room)
        if state == BLOCKED:
            return x, y, heading, math.inf
        cost += abs(piece) * (BACK_COST if way < 0.0 else UNSEEN_COST if state == UNSEEN else 1.0)
    return x, y, heading, cost


@njit(cache=True, nogil=True)
def find(ground: Any, x: float, y: float, heading: float, goal: Any, limits: Any) -> Poses:
    """The poses of the way, the first one where the rover is; no rows when none was found."""
    left, low = int(math.floor(x)) - limits.window, int(math.floor(y)) - limits.window
    known = np.full((2 * limits.window, 2 * limits.window), -1, np.int8)
    to_go = _flood(ground, known, left, low, goal, limits)
    count = to_go.shape[0]
    most = limits.expansions * 2 * len(SHARES) + 1
    poses = np.empty((most, 4))
    costs = np.empty(most)
    before = np.full(most, -1, np.int64)
    best = np.full(count * count * HEADINGS, np.inf, np.float32)
    poses[0, 0], poses[0, 1], poses[0, 2], poses[0, 3] = x, y, heading, 0.0
    costs[0] = 0.0
    used = 1
    queue = [(0.0, 0)]
    expanded = 0
    while queue:
        _, here = heapq.heappop(queue)
        if here < 0:
            return _way_back(poses, before, -here)
        bin_here = _bin(poses[here], left, low, count, limits.bin)
        if here > 0 and costs[here] > best[bin_here]:
            continue
        end = _arrival(goal, poses[here, 0], poses[here, 1], poses[here, 2])
        if end < math.inf and here > 0:
            heapq.heappush(queue, (costs[here] + end, -here))
        expanded += 1
        if expanded > limits.expansions:
            break
        for way in (1.0, -1.0):
            if here == 0 and way * limits.first_way < 0.0:
                continue
            for share in SHARES:
                nx, ny, turned, cost = _arc_cost(
                    ground, known, left, low, poses[here], share * limits.sharpest, way, limits
                )
                if cost == math.inf:
                    continue
                if poses[here, 3] * way < 0.0:
                    cost += limits.switch_cost
                cost = costs[here] + cost * (1.0 + 0.1 * abs(share))
                bin_x, bin_y = int(nx - left) // limits.bin, int(ny - low) // limits.bin
                if not (0 <= bin_x < count and 0 <= bin_y < count) or to_go[bin_y, bin_x] == math.inf:
                    continue
                poses[used, 0], poses[used, 1], poses[used, 2], poses[used, 3] = nx, ny, turned, way
                bin_there = _bin(poses[used], left, low, count, limits.bin)
                if cost >= best[bin_there]:
                    continue
                best[bin_there] = cost
                costs[used] = best[bin_there]
                before[used] = here
                estimate = max(to_go[bin_y, bin_x], _turn_cost(goal, turned, limits.sharpest))
                heapq.heappush(queue, (cost + GREED * estimate, used))
                used += 1
    return np.empty((0, 4))


@njit(cache=True, nogil=True)
def _bin(pose: Any, left: int, low: int, count: int, side: int) -> int:
    x, y = int(pose[0] - left) // side, int(pose[1] - low) // side
    turned = pose[2] % (2.0 * math.pi)
    return (y * count + x) * HEADINGS + int(turned / (2.0 * math.pi) * HEADINGS) % HEADINGS


@njit(cache=True, nogil=True)
def _way_back(poses: Poses, before: Any, last: int) -> Poses:
    count = 0
    at = last
    while at >= 0:
        count += 1
        at = before[at]
    way = np.empty((count, 4))
    at = last
    for i in range(count - 1, -1, -1):
        way[i] = poses[at]
        at = before[at]
    return way
