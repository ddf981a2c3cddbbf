"""The genetic algorithm of Wang, Sillitoe & Mulvaney 2007: paths along obstacle corners, speeds, moving obstacles.

``vertex++`` is the paper's planner. ``vertex`` is its predecessor for static environments: no speeds, no moving
obstacles, shortest path. To replan on the way, plan anew from the robot's place with the obstacles' new tracks.

Nouns: Wang.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.papers.polygons import Polygons, polygons_of
from companion.planning.papers.wang_kernel import search
from companion.planning.papers.wang_lines import Ground
from companion.planning.papers.wang_moving_obstacles import fleet_of
from companion.planning.papers.wang_operators import Rules, Task
from companion.planning.planner import Capabilities, Outcome, RandomPlanner, from_settings
from companion.planning.problem import Budget, ObstacleTrajectory, Path, PlanningProblem
from companion.planning.raster import CellArray, cells_cost, plain, polyline
from companion.settings import PlannerSettings
from companion.settings.planners import VertexSettings

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """The result of a search.

    ``corners``: shape (n, 2), the vertices of the path, columns x and y; no rows if nothing was found.
    ``speeds_fields_s``: shape (n - 1,). ``value``: equation 1, or 3 plus the constant of equation 4.
    ``first_feasible``: the generation, -1 if there was none.
    """

    corners: Ints
    speeds_fields_s: Floats
    value: float
    first_feasible: int
    generations: int
    evaluations: int


def planned(
    problem: PlanningProblem, settings: VertexSettings, seed: int, *, timed: bool, first_only: bool = False
) -> Plan:
    """One search from a free start to another free field; ``timed``: with speeds and moving obstacles (``vertex++``).

    ``first_only`` stops at the first feasible path.
    """
    height, width = problem.weights.shape
    polygons = _polygons_for(problem, settings)
    movers = problem.moving_obstacles if timed else ()
    start, target = problem.start.y * width + problem.start.x, problem.target.y * width + problem.target.x
    corner_fields = _numbered(polygons.corners, width, height)
    around = _numbered(_mover_corners(movers, settings), width, height)
    pool = np.unique(np.concatenate((corner_fields, around[polygons.owner.ravel()[around] == 0])))
    pool = pool[(pool >= 0) & (pool != start) & (pool != target)]
    low, high = problem.kinematics.speeds_fields_s
    levels = settings.speed_levels if timed and high > low else 1
    speeds = np.linspace(low, high, levels) if levels > 1 else np.array([high])
    weights = {} if timed else {"length_weight": 1.0, "time_weight": 0.0}
    task = Task(
        _ground(polygons, corner_fields, len(pool), problem.corner_cutting),
        fleet_of(movers, settings.mover_safe_fields, settings.mover_timing_s),
        from_settings(Rules, settings, first_only=first_only, **weights),
        speeds,
        pool,
        start,
        target,
    )
    fields, chosen, value, first, generations, evaluations = search(task, seed)
    corners = np.column_stack((fields % width, fields // width))
    return Plan(corners, speeds[chosen[:-1]], value, first, generations, evaluations)


def _polygons_for(problem: PlanningProblem, settings: VertexSettings) -> Polygons:
    """The obstacles enlarged by the safe distance, or by less if start or target would be inside them."""
    weights = plain(problem.weights)
    for share in (1.0, 0.5, 0.0):
        polygons = polygons_of(weights, settings.safe_fields * share)
        if not any(polygons.owner[cell.y, cell.x] for cell in (problem.start, problem.target)):
            break
    return polygons


def _numbered(corners: Ints, width: int, height: int) -> Ints:
    """Field numbers; -1 outside the map."""
    x, y = corners[:, 0], corners[:, 1]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.where(inside, y * width + x, -1)


def _mover_corners(movers: tuple[ObstacleTrajectory, ...], settings: VertexSettings) -> Ints:
    """The corners of squares around moving obstacles, where their segments begin and end: vertices like any other."""
    corners = [
        (round(x + right * reach), round(y + up * reach))
        for mover in movers
        for _, x, y in mover.track[:: max(1, len(mover.track) // settings.mover_corner_rows)]
        for right, up in product((-1, 1), repeat=2)
        for reach in (mover.radius_fields + settings.mover_safe_fields + 1.0,)
    ]
    return np.array(corners, np.int64).reshape(-1, 2)


def _ground(polygons: Polygons, corner_fields: Ints, vertices: int, corner_cutting: bool) -> Ground:
    size = 1024
    while size < min(4 * vertices * vertices, 1 << 18):
        size *= 2
    return Ground(
        polygons.owner,
        corner_fields,
        polygons.rings,
        polygons.obstacle_rings,
        corner_cutting,
        np.full(size, -1, np.int64),
        np.empty(size, np.int32),
    )


class WangGa(RandomPlanner):
    """Both planners. Population and generations come from the settings, not from the budget."""

    def __init__(self, settings: PlannerSettings, timed: bool) -> None:
        self._settings = settings.vertex
        self._timed = timed
        self.name = "vertex++" if timed else "vertex"
        self.capabilities = Capabilities(random=True, any_angle=True, moving_obstacles=timed, speeds=timed)

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        plan = planned(problem, self._settings, seed, timed=self._timed)
        if len(plan.corners) == 0:
            return None, plan.evaluations, plan.generations, 0
        cells, cost = _drawn(weights, plan.corners)
        speeds = plan.speeds_fields_s if self._timed else None
        return Path(cells, cost, plan.corners.astype(np.float64), speeds), plan.evaluations, plan.generations, 0


@njit(cache=True, nogil=True)
def _drawn(weights: Floats, corners: Ints) -> tuple[CellArray, float]:
    cells = polyline(corners)
    return cells, cells_cost(weights, cells)


def vertex(settings: PlannerSettings) -> WangGa:
    """The planner for static environments."""
    return WangGa(settings, timed=False)


def vertex_plus(settings: PlannerSettings) -> WangGa:
    """The planner with speeds and moving obstacles, ``vertex++``."""
    return WangGa(settings, timed=True)
