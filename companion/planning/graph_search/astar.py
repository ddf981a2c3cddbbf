"""A* over the fields, with the octile distance to go: as cheap a path as ``dijkstra``'s, for less work. Compiled.

Hart, Nilsson & Raphael 1968. What is cheapest in all is taken first, from a circular bucket queue over the quantised sum; the last in is
the first out, so of equal ones the search goes on with that nearest the target. Costs themselves are not quantised, and a field that
turns out to be cheaper is taken again, so the width of a bucket decides how fast, never how good.

Where the ground is even, and corners are not cut, most of the work is left out: see ``astar_kernel``.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

from companion.planning.ends import ends_free
from companion.planning.graph_search.astar_kernel import Reached, shortest
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.raster import CellArray, cells_cost, plain
from companion.settings import PlannerSettings

Floats = NDArray[np.float64]
ROOM = 64
"""In the queue, beside one place for each field."""


@njit(cache=True, nogil=True)
def _cheapest(
    weights: Floats, reached: Reached, start_x: int, start_y: int, target_x: int, target_y: int, corner_cutting: bool
) -> tuple[CellArray, float]:
    """The fields of the cheapest path and its cost; no fields if there is none. ``reached``: one 0 for each field."""
    room = weights.size + ROOM
    cells = shortest(weights, reached, room, start_x, start_y, target_x, target_y, corner_cutting)
    return cells, cells_cost(weights, cells) if len(cells) else np.inf


class Astar:
    """The cheapest path, or the proof that there is none."""

    name = "astar"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def __init__(self, settings: PlannerSettings) -> None:
        del settings  # nothing to set

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH; budget and generator are left alone."""
        del budget, rng
        if not ends_free(problem):
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        weights = plain(problem.weights)
        # Zeros of numpy's come from the system as needed; a compiled function would write each of them.
        reached = np.zeros(weights.size, np.int64)
        cells, cost = _cheapest(weights, reached, *problem.start, *problem.target, problem.corner_cutting)
        if len(cells) == 0:
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        return PlanResult(PlanStatus.FOUND, Path(cells, cost), self.name)
