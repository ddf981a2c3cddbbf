"""D* Lite: the cheapest path, found again with little work after a small change of the map.

Koenig & Likhachev 2002. The planner remembers its last search. While target, map size and rules stay the same, it works
in only what has changed in the map and how the start has moved; otherwise it searches anew. The cost of a path does not
depend on earlier plans, but which of several equally cheap paths is found may.

Nouns: D* Lite.
"""

from __future__ import annotations

import numpy as np

from companion.core.grid import Weights
from companion.planning.graph_search.dstar_kernel import Search, changes, note_changes, solve
from companion.planning.graph_search.heap import empty_queue
from companion.planning.graph_search.steps import least_cost, octile
from companion.planning.planner import Capabilities, CompletePlanner
from companion.planning.problem import Path, PlanningProblem
from companion.planning.raster import cells_cost
from companion.settings import PlannerSettings

ANEW_SHARE = 0.1
"""If a larger share of the map has changed, a new search is less work than the repair."""
SLACK = 1e-6
"""Costs that differ by less may have been taken in the wrong order because of rounding."""


class DstarLite(CompletePlanner):
    """The cheapest path, or the proof that there is none.

    Use one object for one drive and one thread: it has a memory.
    """

    name = "dstar-lite"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def __init__(self, settings: PlannerSettings) -> None:
        super().__init__(settings)
        self._search: Search | None = None

    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        search = _updated(self._search, weights, problem) or _begun(weights, problem)
        self._search = None  # if this is interrupted, a half-finished search must not be remembered
        cells = solve(search, SLACK)
        self._search = search
        return Path(cells, float(cells_cost(weights, cells))) if len(cells) else None


def _begun(weights: Weights, problem: PlanningProblem) -> Search:
    """A new search, which knows only the target."""
    fields, width = weights.size, weights.shape[1]
    start, target = (cell.y * width + cell.x for cell in (problem.start, problem.target))
    flat = weights.ravel().copy()
    least = float(least_cost(flat, flat[target]))
    g, rhs = np.full(fields, np.inf), np.full(fields, np.inf)
    rhs[target] = 0.0
    return Search(flat, width, problem.corner_cutting, start, target, least, 0.0, g, rhs, empty_queue(fields))


def _updated(search: Search | None, weights: Weights, problem: PlanningProblem) -> Search | None:
    """The remembered search with the changes since then; None if it cannot be used any more."""
    width = weights.shape[1]
    start, target = (cell.y * width + cell.x for cell in (problem.start, problem.target))
    same = (weights.size, width, target, problem.corner_cutting)
    if search is None or same != (search.weights.size, search.width, search.target, search.corner_cutting):
        return None
    changed = np.empty(int(ANEW_SHARE * weights.size) + 1, np.int64)
    count = changes(search.weights, weights.ravel(), changed)
    # With ground cheaper than any before, the remembered heuristic would overestimate.
    if count > len(changed) or (count and search.weights[changed[:count]].min() < search.least):
        return None
    moved = search.least * octile(start % width - search.start % width, start // width - search.start // width)
    search = search._replace(start=start, passed=search.passed + moved)
    note_changes(search, changed[:count])
    return search
