"""The genetic algorithm of Achour & Chaalal 2011: a path grows by segments, each the fittest of a small population.

Nouns: Achour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from companion.core.grid import Weights
from companion.planning.papers.achour_kernel import Effort, Task, search
from companion.planning.planner import Capabilities, Outcome, RandomPlanner, from_settings
from companion.planning.problem import Budget, Path, PlanningProblem
from companion.planning.raster import CellArray, cells_cost, plain, polyline, without_loops
from companion.settings import PlannerSettings
from companion.settings.planners import AchourSettings


@dataclass(frozen=True, eq=False, slots=True)
class Walk:
    """The result of a search.

    ``nodes``: shape (n, 2), columns x and y, start and target included; no rows if the target was not reached.
    ``last_iterations``: those of the last attempt (the paper's N). ``iterations``: those of all attempts.
    """

    nodes: CellArray
    attempts: int
    last_iterations: int
    iterations: int
    evaluations: int


def walked(problem: PlanningProblem, settings: AchourSettings, seed: int) -> Walk:
    """One search from a free start to another free field."""
    task = Task(*problem.start, *problem.target, problem.corner_cutting, settings.unit_fields)
    return Walk(*search(plain(problem.weights), task, from_settings(Effort, settings), seed))


@njit(cache=True, nogil=True)
def drawn(weights: Weights, nodes: CellArray) -> tuple[CellArray, float, bool]:
    """The fields under the lines from node to node, their cost, and whether a loop was cut out of them."""
    line = polyline(nodes)
    cells = without_loops(line)
    return cells, cells_cost(weights, cells), len(cells) < len(line)


def path_through(problem: PlanningProblem, nodes: CellArray) -> Path:
    """The path along nodes that each see the next one. The nodes are its curve, unless they make a loop."""
    cells, cost, looped = drawn(plain(problem.weights), nodes)
    return Path(cells, cost, None if looped else nodes.astype(np.float64))


class AchourGa(RandomPlanner):
    """The genetic algorithm on segments. Attempts and iterations come from the settings, not from the budget."""

    name = "achour"
    capabilities = Capabilities(random=True, any_angle=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._settings = settings.achour

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        walk = walked(problem, self._settings, seed)
        path = path_through(problem, walk.nodes) if len(walk.nodes) else None
        return path, walk.evaluations, walk.iterations, 0
