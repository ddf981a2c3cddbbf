"""The navigator's default: the genetic algorithm's smooth curve where it is worth it, graph search behind it."""

from __future__ import annotations

from dataclasses import replace

from numpy.random import Generator

from companion.planning.astar import Astar
from companion.planning.bspline_ga import BsplineGa
from companion.planning.planner import Capabilities
from companion.planning.problem import MIN_WEIGHT, Budget, Path, PlanningProblem, PlanResult
from companion.planning.raster import SQRT2, cells_cost, plain
from companion.planning.smoothing import fields_under, smooth
from companion.settings import PlannerSettings


class Hybrid:
    """Fast and smooth where the way is easy, complete where it is not: NO_PATH is a proof.

    A genetic path is taken when it costs at most ``hybrid_tolerance`` times the best possible. A dearer one leads a rover another way
    round than the shortest that its map allows, which in unknown ground costs more than a smooth curve saves; then it is
    the graph's path, pulled straight and rounded.
    """

    name = "hybrid"
    capabilities = Capabilities(proves_no_path=True, random=True, smooth_curve=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._genetic = BsplineGa(settings)
        self._graph = Astar(settings)
        self._tolerance = settings.hybrid_tolerance

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH. Raises ValueError for a budget without sense."""
        # A look of a few epochs finds the easy paths, and often they cannot be better: then the graph is not searched.
        look = replace(budget, control_points=budget.control_points[:1], max_epochs=budget.min_epochs)
        first = self._genetic.plan(problem, look, rng)
        if self._is_good(problem, first, _least_cost(problem)):
            return replace(first, planner=self.name)
        graph = self._graph.plan(problem, budget, rng)
        if graph.path is None:
            return replace(graph, planner=self.name, evaluations=first.evaluations, epochs=first.epochs)
        if self._is_good(problem, first, graph.path.cost):
            return replace(first, planner=self.name)
        # Where the first population failed a second one helps more than further epochs or control points. Only who cannot turn
        # on the spot has no use for the graph's path, and spends the whole budget.
        more = budget if problem.motion.turning_radius_fields > 0.0 else look
        second = self._genetic.plan(problem, more, rng)
        spent = replace(
            second,
            planner=self.name,
            evaluations=first.evaluations + second.evaluations,
            epochs=first.epochs + second.epochs,
        )
        if self._is_good(problem, second, graph.path.cost):
            return spent
        return replace(spent, status=graph.status, path=_smoothed(problem, graph.path), control_points=0)

    def _is_good(self, problem: PlanningProblem, result: PlanResult, best: float) -> bool:
        if result.path is None:
            return False
        # A vehicle that cannot turn on the spot could not drive the graph's path, however cheap.
        return problem.motion.turning_radius_fields > 0.0 or result.path.cost <= self._tolerance * best


def _least_cost(problem: PlanningProblem) -> float:
    """What no path can cost less than: the octile distance over the cheapest ground there is."""
    (x, y), (to_x, to_y) = problem.start, problem.target
    across, along = sorted((abs(to_x - x), abs(to_y - y)))
    return (along + (SQRT2 - 1.0) * across) * max(float(problem.weights.min()), MIN_WEIGHT)


def _smoothed(problem: PlanningProblem, path: Path) -> Path:
    """A curve along the path, and the fields under it; where corners may be cut the paper's rules hold: nothing is smoothed."""
    if problem.corner_cutting:
        return path
    weights = plain(problem.weights)
    curve = smooth(weights, path.cell_array)
    cells = fields_under(curve)
    return Path(cells, cells_cost(weights, cells), curve)
