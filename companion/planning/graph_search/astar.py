"""A* over the fields, with the octile distance as heuristic: as cheap a path as ``dijkstra``'s for less work. Compiled.

Hart, Nilsson & Raphael 1968. The open list is a circular bucket queue over the quantised sum of cost and heuristic.
Within a bucket the last entry comes out first, so of equal sums the search continues with the one nearest the target.
Costs themselves are not quantised, and a field that turns out to be cheaper is expanded again, so the width of a bucket
affects the time only.

Where the ground is even and corners are not cut, most of the work is skipped: see ``astar_kernel``.

Nouns: A*.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.graph_search.astar_kernel import Reached, shortest
from companion.planning.graph_search.steps import Query
from companion.planning.planner import Capabilities, CompletePlanner
from companion.planning.problem import Path, PlanningProblem
from companion.planning.raster import CellArray, cells_cost

Floats = NDArray[np.float64]
ROOM = 64
"""Entries of the queue beyond one for each field."""


@njit(cache=True, nogil=True)
def _cheapest(
    weights: Floats, reached: Reached, start_x: int, start_y: int, target_x: int, target_y: int, corner_cutting: bool
) -> tuple[CellArray, float]:
    """The fields of the cheapest path and its cost; no fields if there is none. ``reached``: a zero for each field."""
    query = Query(start_x, start_y, target_x, target_y, corner_cutting)
    cells = shortest(weights, reached, weights.size + ROOM, query)
    return cells, cells_cost(weights, cells) if len(cells) else np.inf


class Astar(CompletePlanner):
    """The cheapest path, or the proof that there is none."""

    name = "astar"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        # numpy's zeros come from the system when they are used; a compiled function would write each of them.
        reached = np.zeros(weights.size, np.int64)
        cells, cost = _cheapest(weights, reached, *problem.start, *problem.target, problem.corner_cutting)
        return Path(cells, cost) if len(cells) else None
