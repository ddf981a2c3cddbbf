"""The four operators of Wang, Sillitoe & Mulvaney 2007, II.D: crossover, mutation, repair, speed mutation. Compiled.

Offspring go to the rows behind the population. Each operator returns the number of offspring, 0 if it is inhibited.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.papers.wang_lines import Ground, chain_length, crossings, nearest_corner, pulled, ring_of, walk
from companion.planning.papers.wang_moving_obstacles import Fleet, Stretch, exclusion, first_meeting, place
from companion.planning.random_numbers import State, uniform, whole

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = 16
"""How many points of a detour one straight line may skip: more takes longer than it is worth."""


class Rules(NamedTuple):
    """The settings of the algorithm, see ``VertexSettings``. ``first_only``: stop at the first feasible path."""

    length_weight: float
    time_weight: float
    population: int
    generations: int
    populations: int
    most_genes: int
    shorter_side: float
    straight_line: bool
    first_only: bool


class Task(NamedTuple):
    """What is to be solved, between two free fields.

    ``speeds``: the levels, rising; a single one makes the planner for static environments, with three operators.
    ``pool``: the vertices to choose from; the search shuffles them.
    """

    ground: Ground
    fleet: Fleet
    rules: Rules
    speeds: Floats
    pool: Ints
    start: int
    target: int


class Population(NamedTuple):
    """Chromosomes, a row each, and scratch arrays.

    ``marks``: a set of fields, one number for each field of the map. A field is in the set if its number is
    ``marked[0]``, so adding 1 to that empties the set.
    """

    fields: Ints
    speeds: Ints
    faulty: NDArray[np.bool_]
    lengths: Ints
    values: Floats
    order: Ints
    marks: Ints
    marked: Ints
    nothing: Ints
    found: Ints
    room: Ints


@njit(cache=True, nogil=True)
def put(crowd: Population, child: int, length: int) -> bool:
    """Make a chromosome of the genes in ``room`` (row 0: fields, row 1: speeds), without repeated vertices.

    Of repeated ones those of lower locus are dropped. False if the chromosome is still too long.
    """
    genes, levels = crowd.room[0], crowd.room[1]
    crowd.marked[0] += 1
    mark, kept = crowd.marked[0], length
    crowd.marks[genes[0]] = mark  # the start stays where it is
    for i in range(length - 1, 0, -1):
        if crowd.marks[genes[i]] != mark:
            crowd.marks[genes[i]] = mark
            kept -= 1
            genes[kept], levels[kept] = genes[i], levels[i]
    kept -= 1
    genes[kept], levels[kept] = genes[0], levels[0]
    if length - kept > crowd.fields.shape[1]:
        return False
    for i in range(kept, length):
        crowd.fields[child, i - kept] = genes[i]
        crowd.speeds[child, i - kept] = levels[i]
    crowd.lengths[child] = length - kept
    return True


@njit(cache=True, nogil=True)
def load(crowd: Population, row: int, begin: int, end: int, used: int) -> int:
    """Add some genes of a chromosome to ``room``. Returns how many are used then."""
    for i in range(begin, end):
        crowd.room[0, used], crowd.room[1, used] = crowd.fields[row, i], crowd.speeds[row, i]
        used += 1
    return used


@njit(cache=True, nogil=True)
def spare(crowd: Population, i: int) -> int:
    """The row for the first (0) or second (1) offspring."""
    return int(crowd.order[len(crowd.order) - 2 + i])


@njit(cache=True, nogil=True)
def crossed(crowd: Population, a: int, b: int, state: State) -> int:
    """One-point crossover, the point chosen in each parent, since they differ in length."""
    length_a, length_b = crowd.lengths[a], crowd.lengths[b]
    cut_a, cut_b = whole(state, 1, length_a - 1), whole(state, 1, length_b - 1)
    used = load(crowd, b, cut_b, length_b, load(crowd, a, 0, cut_a, 0))
    if not put(crowd, spare(crowd, 0), used):
        return 0
    used = load(crowd, a, cut_a, length_a, load(crowd, b, 0, cut_b, 0))
    return 2 if put(crowd, spare(crowd, 1), used) else 1


@njit(cache=True, nogil=True)
def mutated(crowd: Population, parent: int, pool: Ints, state: State) -> int:
    """Another vertex for one gene; inhibited if the chromosome contains it already."""
    length = crowd.lengths[parent]
    if length < 3 or len(pool) == 0:
        return 0
    locus, field = whole(state, 1, length - 2), pool[whole(state, 0, len(pool) - 1)]
    for i in range(length):
        if crowd.fields[parent, i] == field:
            return 0
    load(crowd, parent, 0, length, 0)
    crowd.room[0, locus] = field
    return int(put(crowd, spare(crowd, 0), length))


@njit(cache=True, nogil=True)
def speed_mutated(crowd: Population, parent: int, levels: int, state: State) -> int:
    """Another speed for one gene."""
    length = crowd.lengths[parent]
    load(crowd, parent, 0, length, 0)
    locus, other = whole(state, 0, length - 2), whole(state, 0, levels - 2)
    crowd.room[1, locus] = other + int(other >= crowd.room[1, locus])
    return int(put(crowd, spare(crowd, 0), length))


@njit(cache=True, nogil=True)
def faulty_segment(crowd: Population, row: int, state: State) -> int:
    """One of the infeasible segments, each with the same probability; -1: there is none."""
    chosen, seen = -1, 0
    for i in range(crowd.lengths[row] - 1):
        if crowd.faulty[row, i]:
            seen += 1
            if whole(state, 1, seen) == 1:
                chosen = i
    return chosen


@njit(cache=True, nogil=True)
def round_obstacle(ground: Ground, crowd: Population, which: int, used: int, shorter_side: float, state: State) -> int:
    """Add the corners round an obstacle to the detour in ``room[2]``. Returns how many points it has then."""
    found, chain, other = crowd.found, crowd.room[2], crowd.room[3]
    begin = nearest_corner(ground, found[which, 0], -1, found[which, 1])
    if begin < 0:
        return used
    ring = ring_of(ground, begin)
    end = nearest_corner(ground, found[which, 0], ring, found[which, 2])
    forwards, backwards = (
        walk(ground, ring, begin, end, 1, chain, used),
        walk(ground, ring, begin, end, -1, other, used),
    )
    if backwards < 0:
        return max(forwards, used)
    width = ground.owner.shape[1]
    if forwards >= 0:
        forwards_longer = chain_length(width, chain, used, forwards) > chain_length(width, other, used, backwards)
        if forwards_longer != (uniform(state) < shorter_side):
            return forwards
    for i in range(used, backwards):
        chain[i] = other[i]
    return backwards


@njit(cache=True, nogil=True)
def mover_corner(task: Task, crowd: Population, parent: int, segment: int, state: State) -> int:
    """A corner of the exclusion area that this segment enters, at that time; -1: no mover, or not on free ground."""
    ground, fleet, speeds = task.ground, task.fleet, task.speeds
    height, width = ground.owner.shape
    fields, time_s = crowd.fields[parent], 0.0
    for i in range(segment + 1):
        x, y, to_x, to_y = fields[i] % width, fields[i] // width, fields[i + 1] % width, fields[i + 1] // width
        speed, distance = speeds[crowd.speeds[parent, i]], math.hypot(to_x - x, to_y - y)
        time_s += distance / speed
    speed_x, speed_y = speed * (to_x - x) / distance, speed * (to_y - y) / distance
    stretch = Stretch(time_s - distance / speed, time_s, float(x), float(y), speed_x, speed_y)
    soonest, met = np.inf, -1
    for mover in range(len(fleet.radii)):
        when = first_meeting(fleet, mover, stretch)
        if when < soonest:
            soonest, met = when, mover
    if met < 0:
        return -1
    mover_x, mover_y, ux, uy, _ = place(fleet, met, soonest)
    mover_speed = math.hypot(ux, uy)
    length, half_width = exclusion(fleet, met, mover_speed, speed)
    ux, uy = (ux / mover_speed, uy / mover_speed) if mover_speed > 0.0 else (1.0, 0.0)
    along = (length + 1.0) * (1.0 if uniform(state) < 0.5 else -1.0)
    across = (half_width + 1.0) * (1.0 if uniform(state) < 0.5 else -1.0)
    corner_x = math.floor(mover_x + along * ux - across * uy + 0.5)
    corner_y = math.floor(mover_y + along * uy + across * ux + 0.5)
    if 0 <= corner_x < width and 0 <= corner_y < height and ground.owner[corner_y, corner_x] == 0:
        return int(corner_y * width + corner_x)
    return -1


@njit(cache=True, nogil=True)
def repaired(task: Task, crowd: Population, parent: int, state: State) -> int:
    """Lead one infeasible segment round all obstacles that it enters."""
    ground, shorter_side = task.ground, task.rules.shorter_side
    segment = faulty_segment(crowd, parent, state)
    fields, length = crowd.fields[parent], crowd.lengths[parent]
    detour = crowd.room[2]
    detour[0], used = fields[segment], 1
    count = crossings(ground, fields[segment], fields[segment + 1], crowd.found)
    for i in range(min(count, len(crowd.found))):
        used = round_obstacle(ground, crowd, i, used, shorter_side, state)
    if count == 0:
        corner = mover_corner(task, crowd, parent, segment, state)
        if corner < 0 or corner == fields[0] or corner == fields[length - 1]:
            return 0
        detour[1], used = corner, 2
    if used >= len(detour):
        return 0
    detour[used] = fields[segment + 1]
    if count > 0:
        used = pulled(ground, detour, used + 1, REACH, crowd.nothing) - 1
    if used - 1 + length > crowd.room.shape[1]:
        return 0
    total = load(crowd, parent, 0, segment + 1, 0)
    for i in range(1, used):
        crowd.room[0, total], crowd.room[1, total] = detour[i], crowd.speeds[parent, segment]
        total += 1
    return int(put(crowd, spare(crowd, 0), load(crowd, parent, segment + 1, length, total)))
