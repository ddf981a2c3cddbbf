"""Dijkstra's algorithm as a textbook has it, in plain Python: how the paper's reference may have looked, for scale."""

from __future__ import annotations

import heapq
import math

from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.problem import MIN_WEIGHT

MOVES = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


def least_cost(weights: Weights, start: Cell, target: Cell) -> float:
    """Cost (see ``path_cost``) of the cheapest 8-connected path, which may cut corners; inf if there is none."""
    rows = weights.tolist()
    height, width = len(rows), len(rows[0])
    costs = {start: 0.0}
    queue = [(0.0, start)]
    while queue:
        cost, here = heapq.heappop(queue)
        if here == target:
            return cost
        if cost > costs[here]:
            continue
        for x, y in MOVES:
            there = Cell(here.x + x, here.y + y)
            if not (0 <= there.x < width and 0 <= there.y < height) or rows[there.y][there.x] >= OBSTACLE:
                continue
            onward = cost + math.hypot(x, y) * max(rows[there.y][there.x], MIN_WEIGHT)
            if onward < costs.get(there, math.inf):
                costs[there] = onward
                heapq.heappush(queue, (onward, there))
    return math.inf
