"""The genetic algorithm of Wang, Sillitoe & Mulvaney 2007, section II. Compiled: one call is one search.

A chromosome is a row of genes, start and target included: a field, the speed towards the next one (as the number of a level) and
whether the way there is infeasible. Fields are numbered row after row. Chromosomes live in rows of fixed length; ``order`` says
which is best, second and so on, and its last two entries are rows for offspring.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.papers.wang_lines import Ground, crossing_count
from companion.planning.papers.wang_movers import Fleet, FleetValues, first_meeting, fit_shares
from companion.planning.papers.wang_operators import Population, crossed, mutated, repaired, speed_mutated
from companion.planning.random_numbers import State, seeded, uniform, whole
from companion.planning.raster import HALF, ONE, SHIFT, fine_steps

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
GroundValues = tuple[NDArray[np.int32], Ints, Ints, Ints, bool, Ints, NDArray[np.int32]]
RulesValues = tuple[float, float, int, int, int, int, float, bool, bool]


class Rules(NamedTuple):
    """The settings as the kernel wants them, see ``VertexSettings``.

    ``speed_levels`` 1 is the planner for static environments: three operators. ``first_only``: stop at the first feasible path.
    """

    length_weight: float
    time_weight: float
    population: int
    generations: int
    populations: int
    most_genes: int
    shorter_side: float
    straight_line: bool
    first_only: bool


@njit(cache=True, nogil=True)
def own_crossing(width: int, fields: Ints, length: int, marks: Ints, mark: int) -> int:
    """The first segment that comes to a field the path was on before; -1: none. A planner's path visits no field twice."""
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
    count = 0
    for mover in range(len(fleet.radii)):
        if first_meeting(fleet, mover, time_s, x, y, speed_x, speed_y, time_s + distance / speed) < np.inf:
            count += 1
    return count


@njit(cache=True, nogil=True)
def evaluate(
    ground: Ground, fleet: Fleet, speeds: Floats, rules: Rules, penalty: float, crowd: Population, row: int
) -> None:
    """Set a chromosome's infeasibility bits and its value: equations 1 and 2, or 3 plus the constant of 4."""
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
def scatter(
    crowd: Population, row: int, start: int, target: int, pool: Ints, longest: int, levels: int, state: State
) -> None:
    """A random chromosome (II.B): random length, random vertices without repetition, random speeds. Shuffles ``pool``."""
    inner = whole(state, 0, longest - 2)
    fields = crowd.fields[row]
    fields[0], fields[inner + 1] = start, target
    for i in range(inner):
        other = whole(state, i, len(pool) - 1)
        pool[i], pool[other] = pool[other], pool[i]
        fields[i + 1] = pool[i]
    for i in range(inner + 1):
        crowd.speeds[row, i] = whole(state, 0, levels - 1)
    crowd.lengths[row] = inner + 2


@njit(cache=True, nogil=True)
def ranking(population: int) -> Floats:
    """The roulette wheel: where each rank's slot ends, slots as wide as the square of the rank counted from the worst."""
    ends = np.empty(population)
    total = 0.0
    for rank in range(population):
        total += float(population - rank) ** 2
        ends[rank] = total
    return ends / total


@njit(cache=True, nogil=True)
def settle(crowd: Population, population: int, children: int) -> None:
    """The offspring replace the worst; ``order`` is put right."""
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
def offspring(
    ground: Ground,
    fleet: Fleet,
    speeds: Floats,
    rules: Rules,
    penalty: float,
    wheel: Floats,
    pool: Ints,
    crowd: Population,
    state: State,
) -> int:
    """One operator, chosen at random, on parents from the wheel (II.D, II.E); how many offspring it made."""
    order, population = crowd.order, rules.population
    kind = whole(state, 0, 3 if len(speeds) > 1 else 2)
    rank = np.searchsorted(wheel, uniform(state), side="right")
    parent = order[rank]
    if kind == 0:
        other = order[np.searchsorted(wheel, uniform(state), side="right")]
        return crossed(crowd, parent, other, state)
    if kind == 1:
        return mutated(crowd, parent, pool, state)
    if kind == 3:
        return speed_mutated(crowd, parent, len(speeds), state)
    feasible = 0
    while feasible < population and crowd.values[order[feasible]] < penalty:
        feasible += 1
    if feasible == population:
        return 0
    if rank < feasible:
        parent = order[whole(state, feasible, population - 1)]
    return repaired(ground, fleet, speeds, crowd, parent, rules.shorter_side, state)


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
    """Whether to stop: nothing feasible in all populations, all generations used up since there was, or nothing can be better.

    A population without a feasible path when its generations are used up is given up for a new one.
    """
    if first < 0:
        return generation >= rules.populations * rules.generations
    return generation >= first + rules.generations or rules.first_only or best <= bound * (1.0 + 1e-12)


@njit(cache=True, nogil=True)
def search(
    ground_values: GroundValues,
    fleet_values: FleetValues,
    rules_values: RulesValues,
    speeds: Floats,
    pool: Ints,
    start: int,
    target: int,
    seed: int,
) -> tuple[Ints, Ints, float, int, int, int]:
    """One whole search. ``speeds``: the levels, rising. ``pool``: the vertices to choose from, which are shuffled.

    Gives fields and speeds of the best chromosome (none if none is feasible), its value, the generation of the first feasible
    one (-1: there was none), generations and evaluations.
    """
    ground, fleet, rules = Ground(*ground_values), Fleet(*fleet_values), Rules(*rules_values)
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
                scatter(crowd, row, start, target, pool, genes, len(speeds), state)
                evaluate(ground, fleet, speeds, rules, penalty, crowd, row)
            crowd.order[:] = np.arange(size + 2)
            crowd.order[:size] = np.argsort(crowd.values[:size], kind="mergesort")
            evaluations += size
            best = crowd.values[crowd.order[0]]
        if first < 0 and best < penalty:
            first = generation
        if settled(rules, generation, first, best, bound):
            break
        generation += 1
        children = offspring(ground, fleet, speeds, rules, penalty, wheel, pool, crowd, state)
        for i in range(children):
            evaluate(ground, fleet, speeds, rules, penalty, crowd, crowd.order[size + i])
        settle(crowd, size, children)
        evaluations += children
        best = crowd.values[crowd.order[0]]
    row = crowd.order[0]
    length = crowd.lengths[row] if first >= 0 else 0
    return crowd.fields[row, :length].copy(), crowd.speeds[row, :length].copy(), best, first, generation, evaluations
