"""Achour & Chaalal 2011: a path grown segment by segment, each the fittest of a small population of segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.random import Generator

from companion.core.grid import Weights
from companion.planning.ends import answered_at_once
from companion.planning.papers.achour_kernel import search
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.random_numbers import draw_seed
from companion.planning.raster import CellArray, cells_cost, plain, polyline, without_loops
from companion.settings import PlannerSettings
from companion.settings.planners import AchourSettings


@dataclass(frozen=True, eq=False, slots=True)
class Walk:
    """A search and what came of it.

    ``nodes``: shape (n, 2), columns x and y, start and target included; no rows if the target was not reached. ``last_iterations`` are those
    of the last attempt (the paper's N), ``iterations`` those of all.
    """

    nodes: CellArray
    attempts: int
    last_iterations: int
    iterations: int
    evaluations: int


def walked(problem: PlanningProblem, settings: AchourSettings, seed: int) -> Walk:
    """One search from a free start to another free field."""
    places = (*problem.start, *problem.target, problem.corner_cutting, settings.unit_fields)
    effort = (settings.samples, settings.neighbours, settings.iterations, settings.attempts, settings.shorten)
    return Walk(*search(plain(problem.weights), places, effort, seed))


@njit(cache=True, nogil=True)
def drawn(weights: Weights, nodes: CellArray) -> tuple[CellArray, float, bool]:
    """The fields under lines from node to node, what they cost, and whether a loop was cut out of them."""
    line = polyline(nodes)
    cells = without_loops(line)
    return cells, cells_cost(weights, cells), len(cells) < len(line)


def path_through(problem: PlanningProblem, nodes: CellArray) -> Path:
    """The path along nodes of which each sees the next; the nodes are its curve unless they lead round a loop."""
    cells, cost, looped = drawn(plain(problem.weights), nodes)
    return Path(cells, cost, None if looped else nodes.astype(np.float64))


class SegmentGa:
    """The genetic algorithm on segments. It never proves that there is no path."""

    name = "achour"
    capabilities = Capabilities(random=True, any_angle=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._settings = settings.achour

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or BUDGET_SPENT; attempts and iterations come from the settings, not the budget."""
        del budget
        seed = draw_seed(rng)
        if (answer := answered_at_once(problem, self.name)) is not None:
            return answer
        walk = walked(problem, self._settings, seed)
        if len(walk.nodes) == 0:
            return PlanResult(PlanStatus.BUDGET_SPENT, None, self.name, walk.evaluations, walk.iterations)
        path = path_through(problem, walk.nodes)
        return PlanResult(PlanStatus.FOUND, path, self.name, walk.evaluations, walk.iterations)
