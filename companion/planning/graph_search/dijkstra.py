"""Dijkstra's algorithm over the fields: the paper's reference planner, complete and optimal. Compiled.

The open list is a circular bucket queue (Dial 1969). A bucket is as wide as the cheapest step, so fields in one bucket
cannot improve each other and their order in it does not matter. Only the queue is quantised; the costs stay exact.
Internally the map has a border of obstacles and its fields are numbered row after row.

Nouns: Dijkstra.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights
from companion.planning.planner import Capabilities, CompletePlanner
from companion.planning.problem import MIN_WEIGHT, Path, PlanningProblem
from companion.planning.raster import SQRT2, CellArray, cells_cost

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True)
def step_costs(weights: Weights) -> tuple[Floats, float, float]:
    """The cost of entering each field of the bordered map (inf: an obstacle), the least and the largest finite cost."""
    height, width = weights.shape
    costs = np.full((height + 2) * (width + 2), np.inf)
    least, largest = np.inf, MIN_WEIGHT
    for y in range(height):
        row = (y + 1) * (width + 2) + 1
        for x in range(width):
            if weights[y, x] < OBSTACLE:
                cost = max(weights[y, x], MIN_WEIGHT)
                costs[row + x] = cost
                least = min(least, cost)
                largest = max(largest, cost)
    return costs, least, largest


@njit(cache=True, nogil=True)
def moves(stride: int) -> NDArray[np.int64]:
    """The eight steps, straight ones first: columns step and, for a diagonal one, the two straight steps beside it."""
    table = np.zeros((8, 3), np.int64)
    table[0, 0], table[1, 0], table[2, 0], table[3, 0] = 1, -1, stride, -stride
    for i in range(4):
        along, across = table[i & 1, 0], table[2 + (i >> 1), 0]
        table[4 + i, 0], table[4 + i, 1], table[4 + i, 2] = along + across, along, across
    return table


@njit(cache=True, nogil=True)
def buckets_needed(least: float, largest: float) -> int:
    """How many buckets hold every step, a power of two."""
    buckets = 4
    while buckets < largest * SQRT2 / least + 3.0:
        buckets *= 2
    return buckets


@njit(cache=True, nogil=True)
def spread(
    costs: Floats, stride: int, start: int, target: int, least: float, largest: float, corner_cutting: bool
) -> Floats:
    """Distances from the start for all fields nearer than the target, and for some others; inf: not reached."""
    table = moves(stride)
    mask = buckets_needed(least, largest) - 1
    # A little narrower than the cheapest step, so that rounding never puts a step's end into its own bucket. So a
    # field is settled once, each step is taken once, and 8 entries for each field are enough. Memory that is never
    # written costs nothing.
    per_cost = (1.0 + 1e-6) / least
    heads = np.full(mask + 1, -1, np.int64)
    entry_field = np.empty(8 * len(costs) + 1, np.int32)
    entry_next = np.empty(8 * len(costs) + 1, np.int32)
    distances = np.full(len(costs), np.inf)
    distances[start] = 0.0
    entry_field[0], entry_next[0], heads[0] = start, -1, 0
    used, waiting, bucket = 1, 1, 0
    while waiting > 0:
        entry = heads[bucket & mask]
        if entry < 0:
            bucket += 1
            continue
        heads[bucket & mask] = entry_next[entry]
        waiting -= 1
        here = entry_field[entry]
        so_far = distances[here]
        if int(so_far * per_cost) < bucket:  # it has been settled from an earlier bucket
            continue
        if here == target:
            break
        for i in range(8):
            field = here + table[i, 0]
            distance = so_far + (costs[field] if i < 4 else costs[field] * SQRT2)
            before = distances[field]
            if not distance < before:
                continue
            if i >= 4 and not corner_cutting and max(costs[here + table[i, 1]], costs[here + table[i, 2]]) == np.inf:
                continue
            distances[field] = distance
            into = int(distance * per_cost)
            if before < np.inf and int(before * per_cost) == into:
                continue
            slot = into & mask
            entry_field[used], entry_next[used], heads[slot] = field, heads[slot], used
            used += 1
            waiting += 1
    return distances


@njit(cache=True, nogil=True)
def trace(costs: Floats, distances: Floats, stride: int, target: int, corner_cutting: bool) -> CellArray:
    """Go back from the target to where the distance is 0; fields of the map in the order of the path.

    Of equally near predecessors the one straight on is taken: fewer bends for the rover.
    """
    table = moves(stride)
    fields = np.empty(len(distances), np.int32)
    count, here, straight_on = 0, target, 0
    while distances[here] > 0.0:
        fields[count] = here
        count += 1
        nearest, best = -1, np.inf
        for turn in range(8):
            i = (straight_on + turn) & 7
            distance = distances[here + table[i, 0]] + costs[here] * (1.0 if i < 4 else SQRT2)
            if not distance < best - 1e-9:
                continue
            if i < 4 or corner_cutting or max(costs[here + table[i, 1]], costs[here + table[i, 2]]) < np.inf:
                nearest, best = i, distance
        straight_on = nearest
        here += table[nearest, 0]
    fields[count] = here
    cells = np.empty((count + 1, 2), np.int64)
    for i in range(count + 1):
        cells[i, 0] = fields[count - i] % stride - 1
        cells[i, 1] = fields[count - i] // stride - 1
    return cells


@njit(cache=True, nogil=True)
def shortest(
    weights: Weights, start_x: int, start_y: int, target_x: int, target_y: int, corner_cutting: bool
) -> tuple[CellArray, float]:
    """The cheapest path between two free fields and its cost; no fields and inf if there is none."""
    costs, least, largest = step_costs(weights)
    stride = weights.shape[1] + 2
    start, target = (start_y + 1) * stride + start_x + 1, (target_y + 1) * stride + target_x + 1
    distances = spread(costs, stride, start, target, least, largest, corner_cutting)
    if distances[target] == np.inf:
        return np.empty((0, 2), np.int64), np.inf
    cells = trace(costs, distances, stride, target, corner_cutting)
    return cells, cells_cost(weights, cells)


class Dijkstra(CompletePlanner):
    """The cheapest path, or the proof that there is none."""

    name = "dijkstra"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        cells, cost = shortest(weights, *problem.start, *problem.target, problem.corner_cutting)
        return Path(cells, cost) if len(cells) else None
