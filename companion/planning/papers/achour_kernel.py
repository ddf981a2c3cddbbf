"""The compiled part of the genetic algorithm of Achour & Chaalal 2011, whose chromosomes are segments.

A segment has two nodes of two whole coordinates each. All segments of a generation begin at the last node of the path
so far, so only their final nodes are stored: arrays of shape (n, 2), columns x and y.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from companion.core.grid import OBSTACLE, Weights
from companion.planning.papers.line_of_sight import free_samples, sees, shortened
from companion.planning.random_numbers import State, seeded, whole
from companion.planning.raster import CellArray


class Task(NamedTuple):
    """Start, target, the rule for corners, and how many fields the unit of length in the equations has."""

    start_x: int
    start_y: int
    target_x: int
    target_y: int
    corner_cutting: bool
    unit_fields: float


class Effort(NamedTuple):
    """How long to search; see ``AchourSettings``."""

    samples: int
    neighbours: int
    iterations: int
    attempts: int
    shorten: bool


@njit(cache=True, nogil=True)
def fitness(x: int, y: int, final_x: int, final_y: int, task: Task) -> float:
    """Equations 4 to 6 for the segment from (x, y) to another field; higher is better.

    d is the length of the way to the target through the segment's final node (equation 5). theta is the magnitude of
    the slope of the straight line from there to the target (equation 6). Where theta is 0 equation 4 has its limit 1/d.
    No segment is fitter than the one that ends at the target.
    """
    to_x, to_y = abs(task.target_x - final_x), abs(task.target_y - final_y)
    way = (math.hypot(final_x - x, final_y - y) + math.hypot(to_x, to_y)) / task.unit_fields
    slope = math.atan2(to_y, to_x)
    if slope == 0.0:
        return 1.0 / way
    return math.exp(-slope / way) / way - math.exp(-way / slope)


@njit(cache=True, nogil=True)
def is_among(points: CellArray, x: int, y: int) -> bool:
    """Whether a field is one of the points."""
    for i in range(len(points)):  # noqa: SIM110 - compiled
        if points[i, 0] == x and points[i, 1] == y:
            return True
    return False


@njit(cache=True, nogil=True)
def nearest_in_sight(
    weights: Weights, samples: CellArray, walk: CellArray, task: Task, finals: CellArray, most: int
) -> int:
    """The first population: the samples nearest to the end of the walk that it sees and has not visited.

    They are written to ``finals``; returns how many.
    """
    x, y = walk[-1]
    squares = np.empty(most, np.int64)
    count = 0
    for i in range(len(samples)):
        to_x, to_y = samples[i]
        square = (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y)
        if count == most and square >= squares[count - 1]:
            continue
        if is_among(walk, to_x, to_y) or not sees(weights, x, y, to_x, to_y, task.corner_cutting):
            continue
        at = min(count, most - 1)
        while at > 0 and squares[at - 1] > square:
            squares[at] = squares[at - 1]
            finals[at] = finals[at - 1]
            at -= 1
        squares[at] = square
        finals[at, 0], finals[at, 1] = to_x, to_y
        count = min(count + 1, most)
    return count


@njit(cache=True, nogil=True)
def cross(weights: Weights, walk: CellArray, task: Task, finals: CellArray, count: int, state: State) -> int:
    """Pair the segments at random and exchange a coordinate of their final nodes (figure 3).

    Offspring are left out that collide, that the initial node does not see, or that the walk has visited. Returns the
    number of segments with the offspring.
    """
    for i in range(count - 1, 0, -1):
        j = whole(state, 0, i)
        x, y = finals[i]
        finals[i] = finals[j]
        finals[j, 0], finals[j, 1] = x, y
    total = count
    for k in range(0, count if count > 1 else 0, 2):
        mate = (k + 1) % count
        for one, other in ((k, mate), (mate, k)):
            x, y = finals[one, 0], finals[other, 1]
            if weights[y, x] >= OBSTACLE or is_among(walk, x, y):
                continue
            if sees(weights, walk[-1, 0], walk[-1, 1], x, y, task.corner_cutting):
                finals[total, 0], finals[total, 1] = x, y
                total += 1
    return total


@njit(cache=True, nogil=True)
def fittest(walk: CellArray, task: Task, finals: CellArray, count: int) -> int:
    """The index of the fittest segment from the end of the walk."""
    best, highest = 0, -np.inf
    for i in range(count):
        value = fitness(walk[-1, 0], walk[-1, 1], finals[i, 0], finals[i, 1], task)
        is_target = finals[i, 0] == task.target_x and finals[i, 1] == task.target_y
        if is_target:  # by the equations it is the fittest; rounding must not change that
            return i
        if value > highest:
            best, highest = i, value
    return best


@njit(cache=True, nogil=True)
def attempt(weights: Weights, task: Task, effort: Effort, walk: CellArray, state: State) -> tuple[int, bool, int]:
    """New samples, then segment by segment towards the target: nodes of the walk, whether it arrived, segments rated.

    ``walk`` has room for ``effort.iterations + 1`` nodes.
    """
    samples = free_samples(weights, effort.samples, state)
    targets = np.array([[task.target_x, task.target_y]])
    samples = np.concatenate((targets, samples))
    finals = np.empty((2 * effort.neighbours + 2, 2), np.int64)
    walk[0, 0], walk[0, 1] = task.start_x, task.start_y
    rated = 0
    for used in range(1, len(walk)):
        so_far = walk[:used]
        count = nearest_in_sight(weights, samples, so_far, task, finals, effort.neighbours)
        if count == 0:
            return used, False, rated
        count = cross(weights, so_far, task, finals, count, state)
        rated += count
        best = fittest(so_far, task, finals, count)
        walk[used] = finals[best]
        if walk[used, 0] == task.target_x and walk[used, 1] == task.target_y:
            return used + 1, True, rated
    return len(walk), False, rated


@njit(cache=True, nogil=True)
def search(weights: Weights, task: Task, effort: Effort, seed: int) -> tuple[CellArray, int, int, int, int]:
    """One whole search between two different free fields.

    Returns the nodes of the path (no rows if none was found), the attempts made, the iterations of the last attempt and
    of all, and the segments rated.
    """
    state = seeded(seed)
    walk = np.empty((effort.iterations + 1, 2), np.int64)
    iterations, rated = 0, 0
    for made in range(1, effort.attempts + 1):
        used, arrived, more = attempt(weights, task, effort, walk, state)
        iterations += used - 1
        rated += more
        if arrived:
            nodes = walk[:used].copy()
            if effort.shorten:
                nodes = shortened(weights, nodes, task.corner_cutting)
            return nodes, made, used - 1, iterations, rated
    return np.empty((0, 2), np.int64), effort.attempts, used - 1, iterations, rated
