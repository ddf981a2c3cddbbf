"""A* over the fields, with the octile distance to go: as cheap a path as ``dijkstra``'s, for less work. Compiled.

Hart, Nilsson & Raphael 1968. What is cheapest in all is taken first, from a circular bucket queue over the quantised sum; the last in is
the first out, so of equal ones the search goes on with that nearest the target. Costs themselves are not quantised, and a field that
turns out to be cheaper is taken again, so the width of a bucket decides how fast, never how good.

Where the ground is even, and corners are not cut, most of the work is left out: see ``astar_kernel``.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.graph_search.astar_kernel import Reached, shortest
from companion.planning.planner import Capabilities, CompletePlanner
from companion.planning.problem import Path, PlanningProblem
from companion.planning.raster import CellArray, cells_cost

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


class Astar(CompletePlanner):
    """The cheapest path, or the proof that there is none."""

    name = "astar"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        # numpy's zeros come from the system when they are used; a compiled function would write each of them.
        reached = np.zeros(weights.size, np.int64)
        cells, cost = _cheapest(weights, reached, *problem.start, *problem.target, problem.corner_cutting)
        return Path(cells, cost) if len(cells) else None
