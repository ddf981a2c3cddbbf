"""The genetic algorithm of Kwasniewski & Gosiewski 2018, section 3. Compiled: one call is one search.

A chromosome has shape (control points, 2): columns x and y in whole fields; its ends are start and target. Of a
population only the selected part is kept, in order of fitness: nothing else ever has descendants. For the same reason
a chromosome's fitness is summed only until it is no better than the last one selected so far, which changes no result.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.grid import OBSTACLE, Weights
from companion.planning import bspline
from companion.planning.chance import State, uniform, whole
from companion.planning.raster import HALF, ONE, SHIFT, CellArray, fine_steps

Chromosomes = NDArray[np.int64]
U = np.uint64


class Tuning(NamedTuple):
    """The settings of the algorithm as the kernel wants them; see ``PlannerSettings``."""

    way_points: int
    span_way_points: int
    mixing: float
    selected_share: float
    mutation_probability: float
    mutation_range: float
    line_probability: float
    line_range: float
    neighbourhood: float
    margin_fields: int
    obstacle_value: float


class Task(NamedTuple):
    """Start, target and the rule for corners."""

    start_x: int
    start_y: int
    target_x: int
    target_y: int
    corner_cutting: bool


@njit(cache=True, nogil=True)
def way_points_for(control_points: int, tuning: Tuning) -> int:
    """How many points of the curve are joined by straight lines (3.4)."""
    return max(tuning.way_points, tuning.span_way_points * (control_points - bspline.DEGREE) + 1)


@njit(cache=True, nogil=True)
def large_value(control_points: int, width: int, height: int, tuning: Tuning) -> float:
    """VLN (3.4): the setting, or more on a map so large that a correct path could cost as much."""
    return max(tuning.obstacle_value, float(way_points_for(control_points, tuning) * max(width, height)))


@njit(cache=True, nogil=True)
def is_correct(value: float, vln: float) -> bool:
    """Whether this is the fitness of a path without an obstacle; half a field is left for rounding."""
    return value < vln - 0.5


@njit(cache=True, nogil=True)
def way_point(genes: CellArray, first: NDArray[np.int64], basis: NDArray[np.float64], i: int) -> tuple[int, int]:
    """Way point ``i`` of a chromosome, rounded to the nearest field centre (3.4)."""
    at = first[i]
    x = basis[i, 0] * genes[at, 0] + basis[i, 1] * genes[at + 1, 0] + basis[i, 2] * genes[at + 2, 0]
    y = basis[i, 0] * genes[at, 1] + basis[i, 1] * genes[at + 1, 1] + basis[i, 2] * genes[at + 2, 1]
    return math.floor(x + 0.5), math.floor(y + 0.5)


@njit(cache=True, nogil=True)
def fitness(
    weights: Weights,
    genes: CellArray,
    first: NDArray[np.int64],
    basis: NDArray[np.float64],
    corner_cutting: bool,
    vln: float,
    limit: float,
) -> float:
    """Equation 5: the sum of the fields under the lines from way point to way point, start and target counting 0.

    Obstacles and fields outside the map count ``vln`` each, a cut corner adds ``vln``; a line that leaves the map is
    not looked at for corners. See ``is_correct``. Stops early once it has reached ``limit``. The lines are those of
    ``raster.line_into``, drawn here once more: a call for each would take longer than the line.
    """
    height, width = weights.shape
    total: float = -weights[genes[-1, 1], genes[-1, 0]]
    x, y = genes[0, 0], genes[0, 1]
    inside = True
    for i in range(1, len(first)):
        to_x, to_y = way_point(genes, first, basis, i)
        steps, step_x, step_y = fine_steps(to_x - x, to_y - y)
        fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
        was_inside, inside = inside, 0 <= to_x < width and 0 <= to_y < height
        safe = was_inside and inside
        strict = safe and not corner_cutting
        for _ in range(steps):
            from_x, from_y = x, y
            fine_x += step_x
            fine_y += step_y
            x, y = fine_x >> SHIFT, fine_y >> SHIFT
            value = vln
            if safe or (0 <= x < width and 0 <= y < height):
                value = weights[U(y), U(x)]  # unsigned: else the compiler looks for negative indices
                worst = value
                if strict:  # looking beside every field is quicker than a branch that nobody can predict
                    beside = max(weights[U(from_y), U(x)], weights[U(y), U(from_x)])
                    worst = max(value, beside if (x != from_x) & (y != from_y) else 0.0)
                if worst >= OBSTACLE:
                    value = vln if value >= OBSTACLE else vln + value
                    if total >= limit:
                        return total
            total += value
        x, y = to_x, to_y
        if total >= limit:
            return total
    return total


@njit(cache=True, nogil=True)
def scatter(genes: CellArray, part: int, width: int, height: int, tuning: Tuning, state: State) -> None:
    """Fill in a chromosome of the initial population (3.3): part 0 line, 1 near the start, 2 anywhere. Ends are set."""
    last = len(genes) - 1
    start_x, start_y, target_x, target_y = genes[0, 0], genes[0, 1], genes[last, 0], genes[last, 1]
    smaller = min(width, height)
    shift, reach = math.ceil(tuning.line_range * smaller), math.ceil(tuning.neighbourhood * smaller)
    margin_x, margin_y = min(tuning.margin_fields, (width - 1) // 2), min(tuning.margin_fields, (height - 1) // 2)
    for i in range(1, last):
        if part == 0:
            genes[i, 0] = start_x + math.floor((target_x - start_x) * i / last + 0.5)
            genes[i, 1] = start_y + math.floor((target_y - start_y) * i / last + 0.5)
            for axis in range(2):
                if uniform(state) < tuning.line_probability:
                    genes[i, axis] += whole(state, -shift, shift)
        elif part == 1:
            genes[i, 0] = whole(state, max(start_x - reach, 0), min(start_x + reach, width - 1))
            genes[i, 1] = whole(state, max(start_y - reach, 0), min(start_y + reach, height - 1))
        else:
            genes[i, 0] = whole(state, margin_x, width - 1 - margin_x)
            genes[i, 1] = whole(state, margin_y, height - 1 - margin_y)


@njit(cache=True, nogil=True)
def breed(genes: CellArray, parents: Chromosomes, mutation_fields: int, tuning: Tuning, state: State) -> None:
    """A new chromosome: equation 6 on two different parents, then mutation (3.7). Parents are in order of fitness.

    The second case of equation 6 is read as D * CB + (1 - D) * CA: the better parent always gets the larger share.
    """
    a = whole(state, 0, len(parents) - 1)
    b = whole(state, 0, len(parents) - 2)
    if b >= a:
        b += 1
    better, other = min(a, b), max(a, b)
    for i in range(1, len(genes) - 1):
        for axis in range(2):
            mixed = tuning.mixing * parents[better, i, axis] + (1.0 - tuning.mixing) * parents[other, i, axis]
            genes[i, axis] = math.floor(mixed + 0.5)
            if uniform(state) < tuning.mutation_probability:
                genes[i, axis] += whole(state, -mutation_fields, mutation_fields)


@njit(cache=True, nogil=True)
def copy_genes(source: CellArray, destination: CellArray) -> None:
    """Element by element: for so few, the assignment of a slice takes several times as long."""
    for i in range(len(source)):
        destination[i, 0], destination[i, 1] = source[i, 0], source[i, 1]


@njit(cache=True, nogil=True)
def select(
    selected: Chromosomes, ranks: NDArray[np.int64], values: NDArray[np.float64], genes: CellArray, value: float
) -> None:
    """Put a chromosome in its rank among the selected (3.5); the last one drops out. Needs value < values[-1].

    ``ranks`` says which of ``selected`` is first, second and so on; ``values`` is in that order.
    """
    place = ranks[-1]
    copy_genes(genes, selected[place])
    rank = len(values) - 1
    while rank > 0 and values[rank - 1] > value:
        values[rank], ranks[rank] = values[rank - 1], ranks[rank - 1]
        rank -= 1
    values[rank], ranks[rank] = value, place


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
    """Evolve paths of so many control points: (best fitness, best chromosome, epochs, evaluations)."""
    height, width = weights.shape
    first, basis = bspline.basis(control_points, way_points_for(control_points, tuning))
    genes = np.empty((control_points, 2), np.int64)
    genes[0, 0], genes[0, 1] = task.start_x, task.start_y
    genes[-1, 0], genes[-1, 1] = task.target_x, task.target_y
    chosen = min(max(int(tuning.selected_share * population), 2), population)
    selected = np.empty((chosen, control_points, 2), np.int64)
    parents = np.empty_like(selected)
    ranks = np.arange(chosen)
    values = np.full(chosen, np.inf)
    vln = large_value(control_points, width, height, tuning)
    mutation_fields = int(tuning.mutation_range * min(width, height) / 2.0)
    for i in range(population):
        scatter(genes, i * 3 // population, width, height, tuning, state)
        value = fitness(weights, genes, first, basis, task.corner_cutting, vln, values[-1])
        if value < values[-1]:
            select(selected, ranks, values, genes, value)
    epoch = 1
    while epoch < max_epochs and (epoch < min_epochs or not is_correct(values[0], vln)):
        for rank in range(chosen):
            copy_genes(selected[ranks[rank]], parents[rank])
        for _ in range(population - chosen):
            breed(genes, parents, mutation_fields, tuning, state)
            value = fitness(weights, genes, first, basis, task.corner_cutting, vln, values[-1])
            if value < values[-1]:
                select(selected, ranks, values, genes, value)
        epoch += 1
    evaluations = population + (epoch - 1) * (population - chosen)
    return values[0], selected[ranks[0]].copy(), epoch, evaluations
