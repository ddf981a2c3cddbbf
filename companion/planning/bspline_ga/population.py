"""A population of the B-spline genetic algorithm and how it evolves over epochs. Compiled: one call is many epochs.

Only the selected part is kept, in order of fitness: nothing else ever has descendants. For the same reason a
chromosome's fitness is summed only until it is no better than the last one selected so far or, where nothing has
descendants any more, than the best. Neither changes a result.

Nouns: population, epoch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.bspline import Basis
from companion.planning.bspline_ga.fitness import (
    GLANCE_FIELDS,
    fitness,
    glance,
    is_correct,
    large_value,
    way_points_for,
)
from companion.planning.bspline_ga.operators import Chromosomes, breed, scatter
from companion.planning.bspline_ga.parameters import Lifetime, Task, Tuning
from companion.planning.bspline_ga.turning import turning_fitness
from companion.planning.bspline_ga.variable_length import breed_any
from companion.planning.random_numbers import State, whole
from companion.planning.raster import CellArray


class Evolution(NamedTuple):
    """What stays the same while a population lives. ``vln``: see ``fitness.large_value``."""

    weights: Weights
    task: Task
    tuning: Tuning
    lifetime: Lifetime
    vln: float


class Population(NamedTuple):
    """The selected chromosomes of this epoch, and in ``parents`` those of the last. Arrays, to be changed in place.

    ``selected`` has shape (selected, most control points, 2); ``counts``, shape (selected,), says how many rows are
    used. ``ranks`` are indices of ``selected``, best first; ``values`` is their fitness in that order. ``spent`` is
    epochs and evaluations. ``first`` and ``basis`` are the two parts of ``bspline.basis``, with one row for every
    number of control points that can occur.
    """

    selected: Chromosomes
    counts: NDArray[np.int64]
    parents: Chromosomes
    parent_counts: NDArray[np.int64]
    ranks: NDArray[np.int64]
    values: NDArray[np.float64]
    spent: NDArray[np.int64]
    first: NDArray[np.int64]
    basis: NDArray[np.float64]
    state: State


@njit(cache=True, nogil=True)
def most_points(control_points: int, tuning: Tuning) -> int:
    """The longest chromosome that can occur."""
    return max(control_points, tuning.most_control_points) if tuning.adaptive else control_points


@njit(cache=True, nogil=True)
def vln_of(weights: Weights, control_points: int, tuning: Tuning) -> float:
    """VLN for chromosomes that begin with so many control points."""
    height, width = weights.shape
    return large_value(most_points(control_points, tuning), width, height, tuning)


@njit(cache=True, nogil=True)
def basis_for(people: Population, control_points: int, tuning: Tuning) -> Basis:
    """The basis for chromosomes of this length."""
    at = control_points - bspline.DEGREE - 1 if tuning.adaptive else 0
    used = way_points_for(control_points, tuning)
    return Basis(people.first[at, :used], people.basis[at, :used])


@njit(cache=True, nogil=True)
def empty_population(control_points: int, population: int, tuning: Tuning, state: State) -> Population:
    """Arrays for a population, and what does not change while it lives."""
    most = most_points(control_points, tuning)
    chosen = min(max(int(tuning.selected_share * population), 2), population)
    selected = np.empty((chosen, most, 2), np.int64)
    samples = way_points_for(most, tuning)
    least = bspline.DEGREE + 1 if tuning.adaptive else control_points
    first = np.empty((most - least + 1, samples), np.int64)
    basis = np.empty((most - least + 1, samples, bspline.DEGREE + 1))
    for count in range(least, most + 1):
        used = way_points_for(count, tuning)
        one = bspline.basis(count, used)
        first[count - least, :used], basis[count - least, :used] = one.first, one.values
    return Population(
        selected,
        np.full(chosen, control_points),
        np.empty_like(selected),
        np.full(chosen, control_points),
        np.arange(chosen),
        np.full(chosen, math.inf),
        np.zeros(2, np.int64),
        first,
        basis,
        state,
    )


@njit(cache=True, nogil=True, forceinline=True)
def measured(evolution: Evolution, genes: CellArray, basis: Basis, limit: float) -> float:
    """A chromosome's fitness, up to the limit."""
    weights, task, vln = evolution.weights, evolution.task, evolution.vln
    if task.turning_radius_fields > 0.0:
        return turning_fitness(weights, genes, task, vln, limit)
    if limit < vln or (limit < math.inf and max(weights.shape[0], weights.shape[1]) > 4 * GLANCE_FIELDS):
        # One obstacle more than the limit has outweighs what the target does not count.
        enough = math.floor(limit / vln) + 1.0
        if glance(weights, genes, basis, enough) >= enough:
            return enough * vln
    return fitness(weights, genes, basis, task, vln, limit)


@njit(cache=True, nogil=True)
def rank_of(ranks: NDArray[np.int64], values: NDArray[np.float64], value: float) -> int:
    """The index where a new chromosome goes among the selected (3.5): that of the last one, which drops out.

    Puts ``ranks`` and ``values`` in order. Needs value < values[-1].
    """
    place: int = ranks[-1]
    rank = len(values) - 1
    while rank > 0 and values[rank - 1] > value:
        values[rank], ranks[rank] = values[rank - 1], ranks[rank - 1]
        rank -= 1
    values[rank], ranks[rank] = value, place
    return place


@njit(cache=True, nogil=True)
def copy_genes(source: CellArray, destination: CellArray, count: int) -> None:
    """Element by element: for so few, assigning a slice takes several times as long."""
    for i in range(count):
        destination[i, 0], destination[i, 1] = source[i, 0], source[i, 1]


@njit(cache=True, nogil=True)
def measured_any(evolution: Evolution, people: Population, genes: CellArray, count: int, limit: float) -> float:
    """``measured`` for a chromosome that uses ``count`` rows, whatever number the population began with."""
    return measured(evolution, genes[:count], basis_for(people, count, evolution.tuning), limit)


@njit(cache=True, nogil=True)
def select_from(
    evolution: Evolution, people: Population, crowd: Chromosomes, numbers: NDArray[np.int64], correct_only: bool
) -> None:
    """Measure and select the first population. ``correct_only``: only find its best correct chromosome."""
    ranks, values, vln = people.ranks, people.values, evolution.vln
    basis = Basis(people.first[0], people.basis[0])
    for i in range(len(crowd)):
        limit = min(values[0], vln - 0.5) if correct_only else values[-1]
        if evolution.tuning.adaptive:
            value = measured_any(evolution, people, crowd[i], numbers[i], limit)
        else:
            value = measured(evolution, crowd[i], basis, limit)
        if value < limit:
            place = rank_of(ranks, values, value)
            copy_genes(crowd[i], people.selected[place], numbers[i])
            people.counts[place] = numbers[i]


@njit(cache=True, nogil=True)
def begin(evolution: Evolution, people: Population, control_points: int) -> None:
    """The first population (3.3): scattered, measured and selected.

    Where one correct path is enough, correct ones are searched for first. That is fast, because every other chromosome
    is dropped at its first obstacle.
    """
    task, tuning, size = evolution.task, evolution.tuning, evolution.lifetime.population
    height, width = evolution.weights.shape
    most = people.selected.shape[1]
    crowd = np.empty((size, most, 2), np.int64)
    numbers = np.full(size, control_points)
    for i in range(size):
        if tuning.adaptive:
            numbers[i] = whole(people.state, control_points, min(2 * control_points, most))
        last = numbers[i] - 1
        crowd[i, 0, 0], crowd[i, 0, 1] = task.start_x, task.start_y
        crowd[i, last, 0], crowd[i, last, 1] = task.target_x, task.target_y
        scatter(crowd[i, : last + 1], i * 3 // size, width, height, tuning, people.state)
    people.spent[0], people.spent[1] = 1, size
    if evolution.lifetime.min_epochs <= 1:
        select_from(evolution, people, crowd, numbers, True)
        if is_correct(people.values[0], evolution.vln):
            return
    select_from(evolution, people, crowd, numbers, False)


@njit(cache=True, nogil=True)
def advance(evolution: Evolution, people: Population, until: int) -> None:
    """Live on until epoch ``until``, or until there is a correct path and ``min_epochs`` are over (3.8)."""
    tuning, lifetime, vln = evolution.tuning, evolution.lifetime, evolution.vln
    height, width = evolution.weights.shape
    mutation_fields = int(tuning.mutation_range * min(width, height) / 2.0)
    selected, counts, ranks, values, spent = people.selected, people.counts, people.ranks, people.values, people.spent
    parents, parent_counts, state = people.parents, people.parent_counts, people.state
    basis = Basis(people.first[0], people.basis[0])
    chosen = len(ranks)
    genes = selected[ranks[0]].copy()
    count = counts[0]
    while spent[0] < until and (spent[0] < lifetime.min_epochs or not is_correct(values[0], vln)):
        for rank in range(chosen):
            copy_genes(selected[ranks[rank]], parents[rank], counts[ranks[rank]])
            parent_counts[rank] = counts[ranks[rank]]
        spent[0] += 1
        childless = spent[0] >= lifetime.max_epochs
        enough = spent[0] >= lifetime.min_epochs
        for _ in range(lifetime.population - chosen):
            limit = values[0] if childless or (enough and is_correct(values[0], vln)) else values[-1]
            if tuning.adaptive:
                count = breed_any(genes, parents, parent_counts, mutation_fields, tuning, state)
                value = measured_any(evolution, people, genes, count, limit)
            else:
                breed(genes, parents, mutation_fields, tuning, state)
                value = measured(evolution, genes, basis, limit)
            if value < limit:
                place = rank_of(ranks, values, value)
                copy_genes(genes, selected[place], count)
                counts[place] = count
        spent[1] += lifetime.population - chosen


@njit(cache=True, nogil=True)
def best_of(people: Population) -> CellArray:
    """The best chromosome."""
    place = people.ranks[0]
    return people.selected[place, : people.counts[place]].copy()


@njit(cache=True, nogil=True)
def evolve(
    weights: Weights, task: Task, tuning: Tuning, lifetime: Lifetime, control_points: int, state: State
) -> tuple[float, CellArray, int, int]:
    """Evolve paths that begin with so many control points: (best fitness, best chromosome, epochs, evaluations)."""
    evolution = Evolution(weights, task, tuning, lifetime, vln_of(weights, control_points, tuning))
    people = empty_population(control_points, lifetime.population, tuning, state)
    begin(evolution, people, control_points)
    advance(evolution, people, lifetime.max_epochs)
    return people.values[0], best_of(people), people.spent[0], people.spent[1]
