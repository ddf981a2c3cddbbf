"""The genetic algorithm of Sedighi et al. 2004 and its two predecessors: paths advance row by row or column by column.

``geisler``: by rows only. ``hermanu``: by rows or by columns, one flag for the whole path. ``sedighi``: both in one
path, with up to two switches.

Nouns: Sedighi.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from companion.core.grid import Cell, Weights
from companion.planning.papers.sedighi_evolution import ONE_FLAG, ROW_WISE, SWITCHING, Tuning, evolve
from companion.planning.papers.sedighi_kernel import square_over, summed
from companion.planning.planner import Capabilities, Outcome, RandomPlanner, from_settings
from companion.planning.problem import Budget, Path, PlanningProblem
from companion.planning.random_numbers import seeded
from companion.planning.raster import CellArray, cells_cost, polyline, without_loops
from companion.settings import PlannerSettings


@njit(cache=True, nogil=True)
def search(
    weights: Weights, start: Cell, target: Cell, tuning: Tuning, seed: int
) -> tuple[bool, CellArray, float, int]:
    """One whole search: (whether there is a path, its fields, its cost, generations)."""
    height, width = weights.shape
    square = square_over(width, height, start, target)
    found, corners, generations = evolve(square, summed(weights), tuning, seeded(seed))
    if not found:
        return False, np.empty((0, 2), np.int64), 0.0, generations
    # A path may cross itself where its movement switches; the loop is cut out.
    cells = without_loops(polyline(corners))
    return True, cells, cells_cost(weights, cells), generations


class SedighiGa(RandomPlanner):
    """One of the three genetic algorithms. Population and generations come from the settings, not from the budget."""

    capabilities = Capabilities(random=True)

    def __init__(self, name: str, freedom: int, settings: PlannerSettings) -> None:
        self.name = name
        self._tuning: Tuning = from_settings(Tuning, settings.sedighi, freedom=freedom)

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        found, cells, cost, generations = search(weights, problem.start, problem.target, self._tuning, seed)
        return Path(cells, cost) if found else None, generations * self._tuning.population, generations, 0


def sedighi(settings: PlannerSettings) -> SedighiGa:
    """The paper's own planner: row-wise and column-wise in one path, two switches."""
    return SedighiGa("sedighi", SWITCHING, settings)


def geisler(settings: PlannerSettings) -> SedighiGa:
    """Row-wise only (the paper's reference 4)."""
    return SedighiGa("geisler", ROW_WISE, settings)


def hermanu(settings: PlannerSettings) -> SedighiGa:
    """Row-wise or column-wise for a whole path (the paper's reference 6)."""
    return SedighiGa("hermanu", ONE_FLAG, settings)
