"""The registered planners by name, how to make one, and how to compile their kernels before a drive.

Nouns: planners by name.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell
from companion.core.own_parts import OwnKind, OwnPartError, blamed, looks_own, made_by, registered
from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.graph_search.astar import Astar
from companion.planning.graph_search.dijkstra import Dijkstra
from companion.planning.graph_search.dstar_lite import DstarLite
from companion.planning.graph_search.theta_star import ThetaStar
from companion.planning.hybrid import Hybrid
from companion.planning.papers.achour_ga import AchourGa
from companion.planning.papers.prm import Prm
from companion.planning.papers.sedighi_ga import geisler, hermanu, sedighi
from companion.planning.papers.sedighi_local import SedighiLocal
from companion.planning.papers.wang_ga import vertex, vertex_plus
from companion.planning.planner import Planner, PlannerFactory
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.raster import cells_cost, first_fault
from companion.settings import PlannerSettings
from companion.storage.validation import alike

PLANNERS: dict[str, PlannerFactory] = {
    "bspline-ga": BsplineGa,
    "hybrid": Hybrid,
    "dijkstra": Dijkstra,
    "astar": Astar,
    "theta-star": ThetaStar,
    "dstar-lite": DstarLite,
    "sedighi": sedighi,
    "sedighi-local": SedighiLocal,
    "geisler": geisler,
    "hermanu": hermanu,
    "vertex": vertex,
    "vertex++": vertex_plus,
    "achour": AchourGa,
    "prm": Prm,
}


class UnknownPlannerError(ValueError):
    """A planner's name that nobody has, or a planner that cannot be loaded. The text is one line."""


def make_planner(name: str, settings: PlannerSettings) -> Planner:
    """The planner of this name; one of another package by ``module:name`` or the name of its entry point.

    Raises UnknownPlannerError.
    """
    if name in PLANNERS:
        return PLANNERS[name](settings)
    if not looks_own(OwnKind.PLANNER, name):
        known = (*PLANNERS, *registered(OwnKind.PLANNER))
        near = alike(name, known)
        hint = f", did you mean {near!r}?" if near else ";"
        raise UnknownPlannerError(f"unknown planner {name!r}{hint} known: {', '.join(known)}; one's own: module:name")
    try:
        own: Planner = made_by(OwnKind.PLANNER, name, ("plan", "name", "capabilities"), settings)
    except OwnPartError as error:
        raise UnknownPlannerError(str(error)) from error
    return own


def warm_up(names: Iterable[str] = tuple(PLANNERS), settings: PlannerSettings | None = None) -> None:
    """Compile the kernels of these planners, or load them from the cache, so that no later plan waits for the compiler.

    The first time on a machine this takes about ten seconds, later less than one. Raises UnknownPlannerError.
    """
    rng = np.random.default_rng(0)
    for name in names:
        planner = make_planner(name, settings or PlannerSettings())
        for problem in (_easy(), _winding()):
            with blamed(OwnKind.PLANNER, name):
                path = planner.plan(problem, Budget(), rng).path
            if path is not None:
                cells_cost(problem.weights, path.cell_array)  # the navigator calls them for the rest of a path
                first_fault(problem.weights, path.cell_array, False)


def _easy() -> PlanningProblem:
    """Any planner finds a way round this."""
    weights = np.full((6, 8), BASE_WEIGHT)
    weights[2:4, 4] = OBSTACLE
    return PlanningProblem(weights, Cell(0, 2), Cell(7, 3))


def _winding() -> PlanningProblem:
    """Walls from alternate sides: too many bends for a few control points, so ``hybrid`` needs its graph search."""
    weights = np.full((9, 25), BASE_WEIGHT)
    weights[:-1, 2::8] = OBSTACLE
    weights[1:, 6::8] = OBSTACLE
    return PlanningProblem(weights, Cell(0, 0), Cell(24, 0))
