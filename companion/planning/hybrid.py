"""The default planner: a genetic algorithm's smooth curve where it is good enough, else a graph search.

Nouns: hybrid.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from companion.core.grid import BASE_WEIGHT
from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.graph_search.astar import Astar
from companion.planning.planner import Capabilities, Planner
from companion.planning.problem import MIN_WEIGHT, Budget, Path, PlanningProblem, PlanResult
from companion.planning.raster import cells_cost, plain
from companion.planning.smoothing import curve_cost, fields_under, smooth
from companion.settings import PlannerSettings


class Hybrid:
    """Fast and smooth for easy problems, complete for others: NO_PATH is a proof.

    The genetic path is used if driving along its curve costs at most ``hybrid_tolerance`` times as much as the graph's
    path after smoothing. A costlier one goes round obstacles on another side, which in unknown ground costs more than a
    smooth curve saves.

    A vehicle that cannot turn on the spot can drive the genetic path, so it may cost as much more as turning towards
    the target does. If it costs more than that, the graph's path is used, and the controller finds the manoeuvres that
    it needs.
    """

    name = "hybrid"
    capabilities = Capabilities(proves_no_path=True, random=True, smooth_curve=True, turning_radius=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self.genetic: Planner = BsplineGa(settings.model_copy(update={"length_fitness": True}))
        self.graph: Planner = Astar(settings)
        self._tolerance = settings.hybrid_tolerance

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH. Raises ValueError for a budget that allows no genetic search."""
        # A few epochs find the easy paths. Often no path can be better, and then the graph is not searched.
        look = replace(budget, control_points=budget.control_points[:1], max_epochs=budget.min_epochs)
        genetic = self.genetic.plan(problem, look, rng)
        turning = _turning_cost(problem)
        genetic_cost = _driving_cost(problem, genetic.path)
        if genetic_cost <= self._tolerance * _least_cost(problem) + turning:
            return replace(genetic, planner=self.name)
        graph = self.graph.plan(problem, budget, rng)
        spent = replace(graph, planner=self.name, evaluations=genetic.evaluations, epochs=genetic.epochs)
        if graph.path is None:
            return spent
        spent = replace(spent, path=_smoothed(problem, graph.path))
        good_cost = self._tolerance * _driving_cost(problem, spent.path) + turning
        if genetic_cost <= good_cost:
            return replace(genetic, planner=self.name)
        if problem.kinematics.turning_radius_fields == 0.0:
            return spent
        return self._with_whole_budget(problem, budget, rng, spent, good_cost)

    def _with_whole_budget(
        self, problem: PlanningProblem, budget: Budget, rng: Generator, spent: PlanResult, good_cost: float
    ) -> PlanResult:
        """A longer genetic search for a vehicle that cannot turn on the spot: it can drive only such a path."""
        genetic = self.genetic.plan(problem, budget, rng)
        evaluations, epochs = spent.evaluations + genetic.evaluations, spent.epochs + genetic.epochs
        if _driving_cost(problem, genetic.path) > good_cost:
            return replace(spent, evaluations=evaluations, epochs=epochs)
        return replace(genetic, planner=self.name, evaluations=evaluations, epochs=epochs)


def _turning_cost(problem: PlanningProblem) -> float:
    """The cost of an arc towards the target, and as much again to return to the line; 0 if it turns on the spot."""
    kinematics = problem.kinematics
    if kinematics.turning_radius_fields <= 0.0 or kinematics.heading_rad is None:
        return 0.0
    bearing_rad = math.atan2(problem.target[1] - problem.start[1], problem.target[0] - problem.start[0])
    turn_rad = abs(math.remainder(bearing_rad - kinematics.heading_rad, 2.0 * math.pi))
    return 2.0 * turn_rad * kinematics.turning_radius_fields * BASE_WEIGHT


def _least_cost(problem: PlanningProblem) -> float:
    """A lower bound for the cost of driving there: the straight line over the cheapest ground."""
    (x, y), (to_x, to_y) = problem.start, problem.target
    return math.hypot(to_x - x, to_y - y) * max(float(problem.weights.min()), MIN_WEIGHT)


def _driving_cost(problem: PlanningProblem, path: Path | None) -> float:
    """The cost of driving along a path's curve (or its fields, if it has no curve); inf without a path."""
    if path is None:
        return math.inf
    curve = path.cell_array.astype(np.float64) if path.curve is None else path.curve
    return float(curve_cost(plain(problem.weights), curve))


def _smoothed(problem: PlanningProblem, path: Path) -> Path:
    """A curve along the path and the fields under it. If corners may be cut (the paper's rule) nothing is smoothed."""
    if problem.corner_cutting:
        return path
    weights = plain(problem.weights)
    curve = smooth(weights, path.cell_array)
    cells = fields_under(curve)
    return Path(cells, cells_cost(weights, cells), curve)
