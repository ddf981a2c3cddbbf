"""Sedighi et al. 2004: paths that go row by row or column by column and may switch twice; with its forerunners.

``geisler`` knows rows only, ``hermanu`` rows or columns by one flag, ``sedighi`` both in one path.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.random import Generator

from companion.core.grid import Weights
from companion.planning.ends import answered_at_once
from companion.planning.papers.sedighi_evolution import ONE_FLAG, ROW_WISE, SWITCHING, Tuning, evolve
from companion.planning.papers.sedighi_kernel import square_over, summed
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.random_numbers import draw_seed, seeded
from companion.planning.raster import CellArray, cells_cost, plain, polyline, without_loops
from companion.settings import PlannerSettings

TuningValues = tuple[int, int, int, int, int, float, float, float, float, float]


@njit(cache=True, nogil=True)
def search(
    weights: Weights, places: tuple[int, int, int, int], settings: TuningValues, seed: int
) -> tuple[bool, CellArray, float, int]:
    """One whole search: (whether there is a path, its fields, its cost, generations)."""
    height, width = weights.shape
    start_x, start_y, target_x, target_y = places
    square = square_over(width, height, (start_x, start_y), (target_x, target_y))
    found, corners, generations = evolve(square, summed(weights), Tuning(*settings), seeded(seed))
    if not found:
        return False, np.empty((0, 2), np.int64), 0.0, generations
    # A path may cross itself where its movement switches; the way round is cut out.
    cells = without_loops(polyline(corners))
    return True, cells, cells_cost(weights, cells), generations


class MonotoneGa:
    """One of the three genetic algorithms. None of them ever proves that there is no path."""

    capabilities = Capabilities(random=True)

    def __init__(self, name: str, freedom: int, settings: PlannerSettings) -> None:
        own = settings.sedighi
        self.name = name
        self._settings = (
            freedom,
            own.population,
            own.generations,
            own.most_genes,
            own.settled_generations,
            own.crossover_probability,
            own.mutated_genes,
            own.length_weight,
            own.turn_weight,
            own.infeasible_factor,
        )

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or BUDGET_SPENT; population and generations come from the settings, not the budget."""
        seed = draw_seed(rng)
        if (answer := answered_at_once(problem, self.name)) is not None:
            return answer
        places = (*problem.start, *problem.target)
        found, cells, cost, generations = search(plain(problem.weights), places, self._settings, seed)
        evaluations = generations * self._settings[1]
        if not found:
            return PlanResult(PlanStatus.BUDGET_SPENT, None, self.name, evaluations, generations)
        return PlanResult(PlanStatus.FOUND, Path(cells, cost), self.name, evaluations, generations)


def sedighi(settings: PlannerSettings) -> MonotoneGa:
    """The paper's own: row-wise and column-wise in one path, two switches."""
    return MonotoneGa("sedighi", SWITCHING, settings)


def geisler(settings: PlannerSettings) -> MonotoneGa:
    """Row-wise only (the paper's reference 4)."""
    return MonotoneGa("geisler", ROW_WISE, settings)


def hermanu(settings: PlannerSettings) -> MonotoneGa:
    """Row-wise or column-wise, one of them for a whole path (the paper's reference 6)."""
    return MonotoneGa("hermanu", ONE_FLAG, settings)
