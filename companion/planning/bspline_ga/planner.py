"""The genetic algorithm of Kwasniewski & Gosiewski 2018: chromosomes are B-spline control points (section 3)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.fitness import is_correct, way_point, way_points_for
from companion.planning.bspline_ga.islands import Archipelago, evolve_islands
from companion.planning.bspline_ga.parameters import Lifetime, Plain, Task, Tuning, task_of, tuning_of
from companion.planning.bspline_ga.population import evolve, vln_of
from companion.planning.bspline_ga.turning import control_of, curve_points
from companion.planning.planner import Capabilities, Outcome, RandomPlanner
from companion.planning.problem import Budget, Path, PlanningProblem
from companion.planning.random_numbers import draw_seed, seeded
from companion.planning.raster import CellArray, cells_cost, polyline, without_loops
from companion.settings import PlannerSettings

Found = tuple[bool, CellArray, NDArray[np.float64], float, int, int, int]
"""Whether there is a path, its fields, its curve, its cost, its control points; epochs and evaluations."""


@njit(cache=True, nogil=True)
def path_of(genes: CellArray, task: Task, way_points: int) -> tuple[CellArray, NDArray[np.float64]]:
    """A chromosome's fields, and its curve with about two points for each field.

    Where a field is visited twice the loop is cut out, and there is no curve (no rows), as it would still contain the
    loop. A vehicle that cannot turn on the spot may need the loop, so it keeps its curve.
    """
    control = genes.astype(np.float64)
    if task.turning_radius_fields > 0.0:
        control = control_of(genes, task)
        points = curve_points(control)
    else:
        basis = bspline.basis(len(genes), way_points)
        points = np.empty((way_points, 2), np.int64)
        for i in range(way_points):
            points[i, 0], points[i, 1] = way_point(genes, basis, i)
    walk = polyline(points)
    cells = without_loops(walk)
    samples = 2 * len(walk) + 1 if len(cells) == len(walk) or task.turning_radius_fields > 0.0 else 0
    return cells, bspline.curve(control, samples)


@njit(cache=True, nogil=True)
def search(
    weights: Weights, places: Plain, settings: Plain, lives: Plain, control_points: NDArray[np.int64], seed: int
) -> Found:
    """One whole search: each number of control points in turn, until one gives a correct path.

    ``places``, ``settings`` and ``lives``: the fields of ``Task``, ``Tuning`` and ``Lifetime``.
    """
    task, tuning, lifetime = Task(*places), Tuning(*settings), Lifetime(*lives)
    state = seeded(seed)
    epochs = 0
    evaluations = 0
    for count in control_points:
        value, genes, spent, tried = evolve(weights, task, tuning, lifetime, count, state)
        epochs += spent
        evaluations += tried
        if is_correct(value, vln_of(weights, count, tuning)):
            cells, curve = path_of(genes, task, way_points_for(len(genes), tuning))
            return True, cells, curve, cells_cost(weights, cells), len(genes), epochs, evaluations
    return False, np.empty((0, 2), np.int64), np.empty((0, 2)), 0.0, 0, epochs, evaluations


def search_islands(
    weights: Weights,
    places: Plain,
    settings: Plain,
    lives: Plain,
    control_points: NDArray[np.int64],
    archipelago: Archipelago,
    seed: int,
) -> Found:
    """The same search on islands."""
    task, tuning, lifetime = Task(*places), Tuning(*settings), Lifetime(*lives)
    rng = np.random.default_rng(seed)
    epochs = 0
    evaluations = 0
    for count in control_points.tolist():
        seeds = np.array([draw_seed(rng) for _ in range(archipelago.islands)], np.int64)
        correct, genes, spent, tried = evolve_islands(weights, task, tuning, lifetime, count, archipelago, seeds)
        epochs += spent
        evaluations += tried
        if correct:
            cells, curve = path_of(genes, task, way_points_for(len(genes), tuning))
            return True, cells, curve, cells_cost(weights, cells), len(genes), epochs, evaluations
    return False, np.empty((0, 2), np.int64), np.empty((0, 2)), 0.0, 0, epochs, evaluations


class BsplineGa(RandomPlanner):
    """The genetic algorithm alone, as the paper's profile uses it.

    ``plan`` raises ValueError for a budget of fewer than 3 control points or 4 chromosomes.
    """

    name = "bspline-ga"
    capabilities = Capabilities(random=True, smooth_curve=True, turning_radius=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._tuning = tuning_of(settings)
        self._archipelago = Archipelago(settings.islands, settings.migrate_every, settings.threads)
        self._by_length = settings.length_fitness

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        counts = counts_of(budget.control_points, budget.population)
        lives = (budget.population, budget.min_epochs, budget.max_epochs)
        common = (weights, task_of(problem, self._by_length), self._tuning, lives, counts)
        if self._archipelago.islands > 1:
            answer = search_islands(*common, self._archipelago, seed)
        else:
            answer = search(*common, seed)
        found, cells, curve, cost, count, epochs, evaluations = answer
        if not found:
            return None, evaluations, epochs, 0
        return Path(cells, cost, curve if len(curve) else None), evaluations, epochs, count


@lru_cache
def counts_of(control_points: tuple[int, ...], population: int) -> NDArray[np.int64]:
    """The numbers of control points for the kernel. Raises ValueError for a budget that allows no search."""
    if not control_points or min(control_points) < bspline.DEGREE + 1:
        raise ValueError(f"a B-spline of degree 2 needs 3 control points or more, not {control_points}")
    if population < 4:
        raise ValueError(f"a population needs 4 chromosomes or more, not {population}")
    return np.array(control_points, np.int64)
