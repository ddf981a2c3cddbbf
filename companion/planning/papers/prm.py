"""PRM: a probabilistic roadmap queried with Lazy A*, the reference planner of Achour & Chaalal 2011 (section IV).

Nouns: PRM.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.grid import Weights
from companion.planning.papers.achour_ga import path_through
from companion.planning.papers.prm_kernel import Effort, search
from companion.planning.planner import Capabilities, Outcome, RandomPlanner, from_settings
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.raster import CellArray, plain
from companion.settings import PlannerSettings
from companion.settings.planners import PrmSettings


@dataclass(frozen=True, eq=False, slots=True)
class Query:
    """The result of a search.

    ``nodes``: those of the path, shape (n, 2), columns x and y, start and target included; no rows if there is none.
    ``roadmap``: how many samples were drawn (the paper's N). ``rounds``: how often in difficult regions. ``lines``: how
    many lines were checked.
    """

    nodes: CellArray
    roadmap: int
    rounds: int
    lines: int


def queried(problem: PlanningProblem, settings: PrmSettings, seed: int) -> Query:
    """One roadmap and its query from a free start to another free field."""
    effort = from_settings(Effort, settings, corner_cutting=problem.corner_cutting)
    return Query(*search(plain(problem.weights), problem.start, problem.target, effort, seed))


class Prm(RandomPlanner):
    """The roadmap, made anew for each plan. Samples and rounds come from the settings, not from the budget."""

    name = "prm"
    capabilities = Capabilities(random=True, any_angle=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._settings = settings.prm

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        query = queried(problem, self._settings, seed)
        path = path_through(problem, query.nodes) if len(query.nodes) else None
        return path, query.lines, query.rounds + 1, 0
