"""Fitness, selection and the main loop of Wang, Sillitoe & Mulvaney 2007, section II. Compiled: one call is one search.

A chromosome is a row of genes, start and target included: a field, the speed towards the next one (the number of a
level) and whether the segment to it is infeasible. Fields are numbered row after row. Chromosomes are stored in rows of
fixed length. ``order`` lists these rows by fitness, best first; its last two entries are the rows for offspring.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.papers.wang_lines import crossing_count
from companion.planning.papers.wang_moving_obstacles import Fleet, Stretch, first_meeting, fit_shares
from companion.planning.papers.wang_operators import (
    Population,
    Rules,
    Task,
    crossed,
    mutated,
    repaired,
    speed_mutated,
)
from companion.planning.random_numbers import State, seeded, uniform, whole
from companion.planning.raster import HALF, ONE, SHIFT, fine_steps

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True, nogil=True)
def own_crossing(width: int, fields: Ints, length: int, marks: Ints, mark: int) -> int:
    """The first segment that visits a field again; -1: none. A planner's path must not visit a field twice."""
    marks[fields[0]] = mark
    for i in range(length - 1):
        x, y = fields[i] % width, fields[i] // width
        steps, step_x, step_y = fine_steps(fields[i + 1] % width - x, fields[i + 1] // width - y)
        fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
        for _ in range(steps):
            fine_x += step_x
            fine_y += step_y
            field = (fine_y >> SHIFT) * width + (fine_x >> SHIFT)
            if marks[field] == mark:
                return i
            marks[field] = mark
    return -1


@njit(cache=True, nogil=True)
def meetings(fleet: Fleet, time_s: float, x: int, y: int, to_x: int, to_y: int, speed: float) -> int:
    """How many moving obstacles a robot meets on its way from field to field."""
    distance = math.hypot(to_x - x, to_y - y)
    speed_x, speed_y = speed * (to_x - x) / distance, speed * (to_y - y) / distance
    stretch = Stretch(time_s, time_s + distance / speed, float(x), float(y), speed_x, speed_y)
    count = 0
    for mover in range(len(fleet.radii)):
        if first_meeting(fleet, mover, stretch) < np.inf:
            count += 1
    return count


@njit(cache=True, nogil=True)
def evaluate(task: Task, penalty: float, crowd: Population, row: int) -> None:
    """Set a chromosome's infeasibility bits and its value: equations 1 and 2, or 3 plus the constant of 4."""
    ground, fleet, speeds, rules = task.ground, task.fleet, task.speeds, task.rules
    width = ground.owner.shape[1]
    fields, length = crowd.fields[row], crowd.lengths[row]
    distance, time_s, hits, bad = 0.0, 0.0, 0, 0
    for i in range(length - 1):
        x, y, to_x, to_y = fields[i] % width, fields[i] // width, fields[i + 1] % width, fields[i + 1] // width
        speed = speeds[crowd.speeds[row, i]]
        count = crossing_count(ground, fields[i], fields[i + 1], crowd.nothing)
        if len(fleet.radii) > 0:
            count += meetings(fleet, time_s, x, y, to_x, to_y, speed)
        crowd.faulty[row, i] = count > 0
        hits += count
        bad += count > 0
        step = math.hypot(to_x - x, to_y - y)
        distance += step
        time_s += step / speed
    if bad == 0:
        crowd.marked[0] += 1
        again = own_crossing(width, fields, length, crowd.marks, crowd.marked[0])
        if again >= 0:
            crowd.faulty[row, again] = True
            hits = bad = 1
    if bad == 0:
        crowd.values[row] = rules.length_weight * distance + rules.time_weight * time_s
    else:
        crowd.values[row] = penalty + hits + hits / bad


@njit(cache=True, nogil=True)
def scatter(task: Task, crowd: Population, row: int, longest: int, state: State) -> None:
    """A random chromosome (II.B): random length, random vertices without repetition, random speeds."""
    pool, levels = task.pool, len(task.speeds)
    inner = whole(state, 0, longest - 2)
    fields = crowd.fields[row]
    fields[0], fields[inner + 1] = task.start, task.target
    for i in range(inner):
        other = whole(state, i, len(pool) - 1)
        pool[i], pool[other] = pool[other], pool[i]
        fields[i + 1] = pool[i]
    for i in range(inner + 1):
        crowd.speeds[row, i] = whole(state, 0, levels - 1)
    crowd.lengths[row] = inner + 2


@njit(cache=True, nogil=True)
def ranking(population: int) -> Floats:
    """The roulette wheel: where each rank's slot ends. Its width is the square of the rank counted from the worst."""
    ends = np.empty(population)
    total = 0.0
    for rank in range(population):
        total += float(population - rank) ** 2
        ends[rank] = total
    return ends / total


@njit(cache=True, nogil=True)
def settle(crowd: Population, population: int, children: int) -> None:
    """The offspring replace the worst; ``order`` is sorted again."""
    order, values = crowd.order, crowd.values
    for i in range(children):
        worst, child = population - 1 - i, population + i
        order[worst], order[child] = order[child], order[worst]
    for at in range(population - children, population):
        row, rank = order[at], at
        while rank > 0 and values[order[rank - 1]] > values[row]:
            order[rank] = order[rank - 1]
            rank -= 1
        order[rank] = row


@njit(cache=True, nogil=True)
def offspring(task: Task, penalty: float, wheel: Floats, crowd: Population, state: State) -> int:
    """Apply one operator, chosen at random, to parents from the wheel (II.D, II.E). Returns the number of offspring."""
    order, population, levels = crowd.order, task.rules.population, len(task.speeds)
    kind = whole(state, 0, 3 if levels > 1 else 2)
    rank = np.searchsorted(wheel, uniform(state), side="right")
    parent = order[rank]
    if kind == 0:
        other = order[np.searchsorted(wheel, uniform(state), side="right")]
        return crossed(crowd, parent, other, state)
    if kind == 1:
        return mutated(crowd, parent, task.pool, state)
    if kind == 3:
        return speed_mutated(crowd, parent, levels, state)
    feasible = 0
    while feasible < population and crowd.values[order[feasible]] < penalty:
        feasible += 1
    if feasible == population:
        return 0
    if rank < feasible:
        parent = order[whole(state, feasible, population - 1)]
    return repaired(task, crowd, parent, state)


@njit(cache=True, nogil=True)
def room_for(population: int, longest: int, fields: int) -> Population:
    """Memory for a population and its offspring."""
    rows, genes = population + 2, longest + 2
    return Population(
        np.zeros((rows, genes), np.int64),
        np.zeros((rows, genes), np.int64),
        np.zeros((rows, genes), np.bool_),
        np.zeros(rows, np.int64),
        np.zeros(rows),
        np.arange(rows),
        np.zeros(fields, np.int64),
        np.zeros(1, np.int64),
        np.empty((0, 3), np.int64),
        np.empty((32, 3), np.int64),
        np.empty((4, 2 * genes + 4), np.int64),
    )


@njit(cache=True, nogil=True)
def settled(rules: Rules, generation: int, first: int, best: float, bound: float) -> bool:
    """Whether to stop: all populations ended without a feasible path, all generations after the first feasible path are
    over, or no path can be better.  A population that has no feasible path after its generations is replaced by a new
    one."""
    if first < 0:
        return generation >= rules.populations * rules.generations
    return generation >= first + rules.generations or rules.first_only or best <= bound * (1.0 + 1e-12)


@njit(cache=True, nogil=True)
def search(task: Task, seed: int) -> tuple[Ints, Ints, float, int, int, int]:
    """One whole search.

    Returns fields and speeds of the best chromosome (none if none is feasible), its value, the generation of the first
    feasible one (-1: there was none), generations and evaluations.
    """
    ground, fleet, rules, speeds, pool, start, target = task
    height, width = ground.owner.shape
    state = seeded(seed)
    fit_shares(fleet, start % width, start // width, speeds[-1])
    longest = min(len(pool) + 2, rules.most_genes)
    crowd, size = room_for(rules.population, longest, height * width), rules.population
    worst_cost = rules.length_weight + rules.time_weight / speeds[0]
    penalty = (len(pool) + 2) * math.hypot(width, height) * worst_cost
    direct = math.hypot(target % width - start % width, target // width - start // width)
    bound = direct * (rules.length_weight + rules.time_weight / speeds[-1])
    wheel = ranking(size)
    best, first, generation, evaluations = np.inf, -1, 0, 0
    while True:
        if best >= penalty and generation % rules.generations == 0:
            for row in range(size):
                genes = 2 if rules.straight_line and row == 0 else longest
                scatter(task, crowd, row, genes, state)
                evaluate(task, penalty, crowd, row)
            crowd.order[:] = np.arange(size + 2)
            crowd.order[:size] = np.argsort(crowd.values[:size], kind="mergesort")
            evaluations += size
            best = crowd.values[crowd.order[0]]
        if first < 0 and best < penalty:
            first = generation
        if settled(rules, generation, first, best, bound):
            break
        generation += 1
        children = offspring(task, penalty, wheel, crowd, state)
        for i in range(children):
            evaluate(task, penalty, crowd, crowd.order[size + i])
        settle(crowd, size, children)
        evaluations += children
        best = crowd.values[crowd.order[0]]
    row = crowd.order[0]
    length = crowd.lengths[row] if first >= 0 else 0
    return crowd.fields[row, :length].copy(), crowd.speeds[row, :length].copy(), best, first, generation, evaluations
