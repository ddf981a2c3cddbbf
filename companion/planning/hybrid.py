"""The navigator's default: the genetic algorithm first, graph search when its budget is spent."""

from __future__ import annotations

from dataclasses import replace

from numpy.random import Generator

from companion.planning.bspline_ga import BsplineGa
from companion.planning.dijkstra import Dijkstra
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, PlanningProblem, PlanResult, PlanStatus
from companion.settings import PlannerSettings


class Hybrid:
    """Fast and smooth where the way is easy, complete where it is not: NO_PATH is a proof."""

    name = "hybrid"
    capabilities = Capabilities(proves_no_path=True, random=True, smooth_curve=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._genetic = BsplineGa(settings)
        self._graph = Dijkstra(settings)

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH. Raises ValueError for a budget without sense."""
        # A look of a few epochs finds the easy paths. Whatever is left is worth its budget only if there is a path
        # at all: on a map of 100 x 50 fields the proof takes as long as some ten epochs, the budget thousands.
        look = replace(budget, control_points=budget.control_points[:1], max_epochs=budget.min_epochs)
        tried = self._genetic.plan(problem, look, rng)
        if tried.status is PlanStatus.FOUND:
            return replace(tried, planner=self.name)
        fallback = self._graph.plan(problem, budget, rng)
        if fallback.status is PlanStatus.NO_PATH:
            return replace(fallback, planner=self.name, evaluations=tried.evaluations, epochs=tried.epochs)
        full = self._genetic.plan(problem, budget, rng)
        return replace(
            full if full.status is PlanStatus.FOUND else fallback,
            planner=self.name,
            evaluations=tried.evaluations + full.evaluations,
            epochs=tried.epochs + full.epochs,
        )
