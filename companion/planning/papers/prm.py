"""A probabilistic roadmap queried with Lazy A*: what Achour & Chaalal 2011 compare their genetic algorithm with (section IV)."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.random import Generator

from companion.planning.ends import answered_at_once
from companion.planning.papers.achour_ga import path_through
from companion.planning.papers.prm_kernel import search
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, PlanningProblem, PlanResult, PlanStatus
from companion.planning.random_numbers import draw_seed
from companion.planning.raster import CellArray, plain
from companion.settings import PlannerSettings
from companion.settings.planners import PrmSettings


@dataclass(frozen=True, eq=False, slots=True)
class Query:
    """A search and what came of it.

    ``nodes``: those of the path, shape (n, 2), columns x and y, start and target included; no rows if there is none. ``roadmap``: how many
    samples were drawn (the paper's N), ``rounds``: how often in difficult regions, ``lines``: how many were looked at.
    """

    nodes: CellArray
    roadmap: int
    rounds: int
    lines: int


def queried(problem: PlanningProblem, settings: PrmSettings, seed: int) -> Query:
    """One roadmap and its query from a free start to another free field."""
    effort = (
        settings.samples,
        settings.neighbours,
        settings.rounds,
        settings.reach,
        settings.difficult_share,
        settings.weight_x,
        settings.weight_y,
        problem.corner_cutting,
    )
    return Query(*search(plain(problem.weights), tuple(problem.start), tuple(problem.target), effort, seed))  # type: ignore[arg-type]


class Prm:
    """The roadmap, made anew for each plan. It never proves that there is no path."""

    name = "prm"
    capabilities = Capabilities(random=True, any_angle=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._settings = settings.prm

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or BUDGET_SPENT; samples and rounds come from the settings, not the budget."""
        del budget
        seed = draw_seed(rng)
        if (answer := answered_at_once(problem, self.name)) is not None:
            return answer
        query = queried(problem, self._settings, seed)
        if len(query.nodes) == 0:
            return PlanResult(PlanStatus.BUDGET_SPENT, None, self.name, query.lines, query.rounds + 1)
        path = path_through(problem, query.nodes)
        return PlanResult(PlanStatus.FOUND, path, self.name, query.lines, query.rounds + 1)
