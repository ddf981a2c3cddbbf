"""A population of Kwasniewski & Gosiewski 2018 that lives some epochs. Compiled: one call is many epochs.

Only the selected part is kept, in order of fitness: nothing else ever has descendants. For the same reason a
chromosome's fitness is summed only until it is no better than the last one selected so far, and where nothing has
descendants any more, than the best. Neither changes a result.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.fitness import (
    GLANCE_FIELDS,
    Task,
    Tuning,
    fitness,
    glance,
    is_correct,
    large_value,
    way_points_for,
)
from companion.planning.bspline_ga.operators import Chromosomes, breed, scatter
from companion.planning.bspline_ga.turning import turning_fitness
from companion.planning.bspline_ga.variable_length import breed_any
from companion.planning.random_numbers import State, whole
from companion.planning.raster import CellArray


class Population(NamedTuple):
    """The selected of one epoch, of the last in ``parents``; arrays, so that they change in place.

    ``selected`` has shape (selected, most control points, 2), ``counts`` (selected,) says how many rows are used.
    ``ranks`` are indices of ``selected``, best first, ``values`` their fitness in that order; ``spent`` is epochs and
    evaluations. ``first`` and ``basis`` are ``bspline.basis`` for every number of control points that can occur.
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


class Span(NamedTuple):
    """How long a population lives: see ``Budget``."""

    population: int
    min_epochs: int
    max_epochs: int


@njit(cache=True, nogil=True)
def most_points(control_points: int, tuning: Tuning) -> int:
    """The longest chromosome there can be."""
    return max(control_points, tuning.most_control_points) if tuning.adaptive else control_points


@njit(cache=True, nogil=True)
def vln_of(weights: Weights, control_points: int, tuning: Tuning) -> float:
    """VLN for chromosomes that begin with so many control points."""
    height, width = weights.shape
    return large_value(most_points(control_points, tuning), width, height, tuning)


@njit(cache=True, nogil=True)
def row_of(control_points: int, tuning: Tuning) -> int:
    """The row of ``Population.first`` and ``basis`` for so many."""
    return control_points - bspline.DEGREE - 1 if tuning.adaptive else 0


@njit(cache=True, nogil=True)
def empty_population(control_points: int, population: int, tuning: Tuning, state: State) -> Population:
    """Room for a population, and what does not change while it lives."""
    most = most_points(control_points, tuning)
    chosen = min(max(int(tuning.selected_share * population), 2), population)
    selected = np.empty((chosen, most, 2), np.int64)
    samples = way_points_for(most, tuning)
    least = bspline.DEGREE + 1 if tuning.adaptive else control_points
    first = np.empty((most - least + 1, samples), np.int64)
    basis = np.empty((most - least + 1, samples, bspline.DEGREE + 1))
    for count in range(least, most + 1):
        used = way_points_for(count, tuning)
        first[count - least, :used], basis[count - least, :used] = bspline.basis(count, used)
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
def measured(
    weights: Weights,
    genes: CellArray,
    first: NDArray[np.int64],
    basis: NDArray[np.float64],
    task: Task,
    vln: float,
    limit: float,
) -> float:
    """A chromosome's fitness, as far as the limit."""
    if task.turning_radius > 0.0:
        return turning_fitness(weights, genes, task, vln, limit)
    if limit < vln or (limit < math.inf and max(weights.shape[0], weights.shape[1]) > 4 * GLANCE_FIELDS):
        # One obstacle more than the limit has outweighs what the target does not count.
        enough = math.floor(limit / vln) + 1.0
        if glance(weights, genes, first, basis, enough) >= enough:
            return enough * vln
    return fitness(weights, genes, first, basis, task.corner_cutting, vln, limit, task.by_length)


@njit(cache=True, nogil=True)
def rank_of(ranks: NDArray[np.int64], values: NDArray[np.float64], value: float) -> int:
    """Makes room for a chromosome among the selected (3.5) and says where; the last one drops out. Needs value < values[-1]."""
    place: int = ranks[-1]
    rank = len(values) - 1
    while rank > 0 and values[rank - 1] > value:
        values[rank], ranks[rank] = values[rank - 1], ranks[rank - 1]
        rank -= 1
    values[rank], ranks[rank] = value, place
    return place


@njit(cache=True, nogil=True)
def copy_genes(source: CellArray, destination: CellArray, count: int) -> None:
    """Element by element: for so few, the assignment of a slice takes several times as long."""
    for i in range(count):
        destination[i, 0], destination[i, 1] = source[i, 0], source[i, 1]


@njit(cache=True, nogil=True)
def measured_any(
    weights: Weights,
    people: Population,
    genes: CellArray,
    count: int,
    task: Task,
    tuning: Tuning,
    vln: float,
    limit: float,
) -> float:
    """The same for a chromosome that uses ``count`` rows, whatever the population began with."""
    at, used = row_of(count, tuning), way_points_for(count, tuning)
    return measured(weights, genes[:count], people.first[at, :used], people.basis[at, :used], task, vln, limit)


@njit(cache=True, nogil=True)
def select_from(
    weights: Weights,
    people: Population,
    crowd: Chromosomes,
    numbers: NDArray[np.int64],
    task: Task,
    tuning: Tuning,
    vln: float,
    correct_only: bool,
) -> None:
    """Measure and select the first population; ``correct_only``: only to find its best correct one."""
    ranks, values = people.ranks, people.values
    first, basis = people.first[0], people.basis[0]
    for i in range(len(crowd)):
        limit = min(values[0], vln - 0.5) if correct_only else values[-1]
        if tuning.adaptive:
            value = measured_any(weights, people, crowd[i], numbers[i], task, tuning, vln, limit)
        else:
            value = measured(weights, crowd[i], first, basis, task, vln, limit)
        if value < limit:
            place = rank_of(ranks, values, value)
            copy_genes(crowd[i], people.selected[place], numbers[i])
            people.counts[place] = numbers[i]


@njit(cache=True, nogil=True)
def begin(
    weights: Weights, people: Population, task: Task, tuning: Tuning, control_points: int, span: Span, vln: float
) -> None:
    """The first population (3.3), scattered, measured and selected.

    Where one correct path is enough, correct ones are looked for first: that is soon done, since every other
    chromosome is left at its first obstacle.
    """
    height, width = weights.shape
    most = people.selected.shape[1]
    crowd = np.empty((span.population, most, 2), np.int64)
    numbers = np.full(span.population, control_points)
    for i in range(span.population):
        if tuning.adaptive:
            numbers[i] = whole(people.state, control_points, min(2 * control_points, most))
        last = numbers[i] - 1
        crowd[i, 0, 0], crowd[i, 0, 1] = task.start_x, task.start_y
        crowd[i, last, 0], crowd[i, last, 1] = task.target_x, task.target_y
        scatter(crowd[i, : last + 1], i * 3 // span.population, width, height, tuning, people.state)
    people.spent[0], people.spent[1] = 1, span.population
    if span.min_epochs <= 1:
        select_from(weights, people, crowd, numbers, task, tuning, vln, True)
        if is_correct(people.values[0], vln):
            return
    select_from(weights, people, crowd, numbers, task, tuning, vln, False)


@njit(cache=True, nogil=True)
def advance(
    weights: Weights, people: Population, task: Task, tuning: Tuning, span: Span, vln: float, until: int
) -> None:
    """Live on until epoch ``until``, or until a correct path is there and ``min_epochs`` are over (3.8)."""
    height, width = weights.shape
    mutation_fields = int(tuning.mutation_range * min(width, height) / 2.0)
    selected, counts, ranks, values, spent = people.selected, people.counts, people.ranks, people.values, people.spent
    parents, parent_counts, first, basis, state = (
        people.parents,
        people.parent_counts,
        people.first[0],
        people.basis[0],
        people.state,
    )
    chosen = len(ranks)
    genes = selected[ranks[0]].copy()
    count = counts[0]
    while spent[0] < until and (spent[0] < span.min_epochs or not is_correct(values[0], vln)):
        for rank in range(chosen):
            copy_genes(selected[ranks[rank]], parents[rank], counts[ranks[rank]])
            parent_counts[rank] = counts[ranks[rank]]
        spent[0] += 1
        childless = spent[0] >= span.max_epochs
        enough = spent[0] >= span.min_epochs
        for _ in range(span.population - chosen):
            limit = values[0] if childless or (enough and is_correct(values[0], vln)) else values[-1]
            if tuning.adaptive:
                count = breed_any(genes, parents, parent_counts, mutation_fields, tuning, state)
                value = measured_any(weights, people, genes, count, task, tuning, vln, limit)
            else:
                breed(genes, parents, mutation_fields, tuning, state)
                value = measured(weights, genes, first, basis, task, vln, limit)
            if value < limit:
                place = rank_of(ranks, values, value)
                copy_genes(genes, selected[place], count)
                counts[place] = count
        spent[1] += span.population - chosen


@njit(cache=True, nogil=True)
def best_of(people: Population) -> CellArray:
    """The best chromosome."""
    place = people.ranks[0]
    return people.selected[place, : people.counts[place]].copy()


@njit(cache=True, nogil=True)
def evolve(
    weights: Weights,
    task: Task,
    tuning: Tuning,
    control_points: int,
    population: int,
    min_epochs: int,
    max_epochs: int,
    state: State,
) -> tuple[float, CellArray, int, int]:
    """Evolve paths that begin with so many control points: (best fitness, best chromosome, epochs, evaluations)."""
    vln = vln_of(weights, control_points, tuning)
    span = Span(population, min_epochs, max_epochs)
    people = empty_population(control_points, population, tuning, state)
    begin(weights, people, task, tuning, control_points, span, vln)
    advance(weights, people, task, tuning, span, vln, max_epochs)
    return people.values[0], best_of(people), people.spent[0], people.spent[1]
