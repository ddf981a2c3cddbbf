"""Selection, crossover and mutation of Sedighi et al. 2004 and its two predecessors.

Compiled: one call is one search.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.papers.sedighi_kernel import Chromosomes, Numbers, ObstacleCounts, Square, corners_of, measure
from companion.planning.random_numbers import State, uniform, whole
from companion.planning.raster import CellArray

ROW_WISE, ONE_FLAG, SWITCHING = 0, 1, 2
"""How much of the genotype is free: Geisler's, Hermanu's, Sedighi's."""


class Tuning(NamedTuple):
    """The settings of the algorithm; see ``SedighiSettings``. ``freedom``: ROW_WISE, ONE_FLAG or SWITCHING."""

    freedom: int
    population: int
    generations: int
    most_genes: int
    settled_generations: int
    crossover_probability: float
    mutated_genes: float
    length_weight: float
    turn_weight: float
    infeasible_factor: float


@njit(cache=True, nogil=True)
def share_of_range(value: int, least: int, most: int) -> float:
    """1 for the least value of the population, 0 for the greatest, 1 where all are the same."""
    return 1.0 if most == least else (most - value) / (most - least)


@njit(cache=True, nogil=True)
def rate(measures: Numbers, fitness: NDArray[np.float64], tuning: Tuning) -> None:
    """Equations 1 and 2. ``measures`` has shape (population, 3): length, turns, collisions; ``fitness`` is written."""
    least, most = measures[0].copy(), measures[0].copy()
    for i in range(1, len(measures)):
        for j in range(3):
            least[j] = min(least[j], measures[i, j])
            most[j] = max(most[j], measures[i, j])
    weight = tuning.length_weight + tuning.turn_weight
    for i in range(len(measures)):
        short = tuning.length_weight * share_of_range(measures[i, 0], least[0], most[0])
        straight = tuning.turn_weight * share_of_range(measures[i, 1], least[1], most[1])
        collisions = measures[i, 2]
        fitness[i] = share_of_range(collisions, least[2], most[2]) * (short + straight) * 100.0 / weight
        if collisions > 0:
            fitness[i] *= tuning.infeasible_factor / (collisions * collisions)


@njit(cache=True, nogil=True)
def rank(fitness: NDArray[np.float64], order: Numbers) -> None:
    """Sort the indices of the population by fitness, best first. By insertion, as they are nearly sorted."""
    for i in range(len(order)):
        order[i] = i
    for i in range(1, len(order)):
        moved = order[i]
        at = i
        while at > 0 and fitness[order[at - 1]] < fitness[moved]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = moved


@njit(cache=True, nogil=True)
def select(order: Numbers, state: State) -> int:
    """Rank selection: of P chromosomes the best is drawn P times as often as the worst."""
    count = len(order)
    ticket = whole(state, 0, count * (count + 1) // 2 - 1)
    step = int((math.sqrt(8.0 * ticket + 1.0) - 1.0) / 2.0)
    return int(order[count - 1 - step])


@njit(cache=True, nogil=True)
def scatter(population: Chromosomes, sides: int, tuning: Tuning, state: State) -> None:
    """The first population: every part of a chromosome at random."""
    count, genes = population.locations.shape
    for i in range(count):
        for k in range(genes):
            population.locations[i, k] = whole(state, 0, sides - 1)
            population.directions[i, k] = whole(state, 0, 1)
        population.modes[i, 0] = whole(state, 0, 1) if tuning.freedom >= ONE_FLAG else 0
        for j in range(1, 3):
            population.modes[i, j] = whole(state, 0, genes - 1) if tuning.freedom >= SWITCHING else genes - 1


@njit(cache=True, nogil=True)
def inherit(old: Chromosomes, new: Chromosomes, child: int, head: int, tail: int, cut: int) -> None:
    """One offspring: genes before ``cut`` and the modes from one parent, the others from the other (figure 7)."""
    for k in range(old.locations.shape[1]):
        parent = head if k < cut else tail
        new.locations[child, k] = old.locations[parent, k]
        new.directions[child, k] = old.directions[parent, k]
    for j in range(3):
        new.modes[child, j] = old.modes[head, j]


@njit(cache=True, nogil=True)
def mutate(population: Chromosomes, child: int, sides: int, tuning: Tuning, state: State) -> None:
    """Draw genes, the flag and switch values again, each with the mutation's probability (section IV.C)."""
    genes = population.locations.shape[1]
    probability = tuning.mutated_genes / genes
    for k in range(genes):
        if uniform(state) < probability:
            population.locations[child, k] = whole(state, 0, sides - 1)
            population.directions[child, k] = whole(state, 0, 1)
    if tuning.freedom >= ONE_FLAG and uniform(state) < probability:
        population.modes[child, 0] = whole(state, 0, 1)
    if tuning.freedom >= SWITCHING:
        for j in range(1, 3):
            if uniform(state) < probability:
                population.modes[child, j] = whole(state, 0, genes - 1)


@njit(cache=True, nogil=True)
def breed(
    old: Chromosomes, new: Chromosomes, elite: int, order: Numbers, sides: int, tuning: Tuning, state: State
) -> None:
    """The next generation: the elite unchanged, then pairs of offspring."""
    count, genes = old.locations.shape
    inherit(old, new, 0, elite, elite, genes)
    child = 1
    while child < count:
        one, other = select(order, state), select(order, state)
        cut = genes
        if uniform(state) < tuning.crossover_probability:
            cut = whole(state, 1, genes - 1)
        inherit(old, new, child, one, other, cut)
        mutate(new, child, sides, tuning, state)
        if child + 1 < count:
            inherit(old, new, child + 1, other, one, cut)
            mutate(new, child + 1, sides, tuning, state)
        child += 2


@njit(cache=True, nogil=True)
def elite_of(order: Numbers, measures: Numbers) -> int:
    """The fittest chromosome without collisions or, if there is none, the fittest of all.

    By equations 1 and 2 alone, a free path that is the longest and has the most turns may be less fit than one that
    collides.
    """
    for i in order:
        if measures[i, 2] == 0:
            return int(i)
    return int(order[0])


@njit(cache=True, nogil=True)
def same(one: Numbers, other: Numbers) -> bool:
    """Whether two paths measure the same."""
    return bool(one[0] == other[0] and one[1] == other[1] and one[2] == other[2])


@njit(cache=True, nogil=True)
def empty_population(count: int, genes: int) -> Chromosomes:
    """Room for a population."""
    return Chromosomes(
        np.empty((count, genes), np.int64), np.empty((count, genes), np.int64), np.empty((count, 3), np.int64)
    )


@njit(cache=True, nogil=True)
def evolve(square: Square, ground: ObstacleCounts, tuning: Tuning, state: State) -> tuple[bool, CellArray, int]:
    """Evolve: (whether the best path is free, its corners, generations)."""
    count, genes, sides = tuning.population, len(square.gene_rows), len(square.place_rows)
    old, new = empty_population(count, genes), empty_population(count, genes)
    measures = np.empty((count, 3), np.int64)
    fitness = np.empty(count)
    order = np.arange(count)
    scatter(old, sides, tuning, state)
    best = np.full(3, -1)
    settled = generation = 0
    last = min(tuning.generations, max(tuning.most_genes // (count * genes), 1))
    while True:
        generation += 1
        measure(square, ground, old, measures)
        rate(measures, fitness, tuning)
        rank(fitness, order)
        elite = elite_of(order, measures)
        settled = settled + 1 if same(best, measures[elite]) else 0
        best[:] = measures[elite]
        if generation == last or (best[2] == 0 and settled >= tuning.settled_generations):
            break
        breed(old, new, elite, order, sides, tuning, state)
        old.locations[:], old.directions[:], old.modes[:] = new.locations, new.directions, new.modes
    corners = corners_of(square, old, elite)
    return best[2] == 0, corners, generation
