"""The shortest way over ground that keeps some room on both sides, on coarse fields.

Nouns: shortest way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights, inflated
from companion.planning.graph_search.theta_star import any_angle
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.generators.canvas import FINE_M
from sitl.world.world import Obstacles

WAY_RESOLUTION_M = 0.2
BODY_M = 0.6
"""Without another word there is a way with so much room on both sides."""
FREE = 0.5
"""The weight of free ground."""

Place = tuple[float, float]
"""Metres north and east."""
Way = NDArray[np.float64]
"""Places, metres north and east, shape (n, 2)."""


def coarse(solid: Obstacles, side_m: float = FINE_M, to_m: float = WAY_RESOLUTION_M) -> Obstacles:
    """Coarse fields in which anything stands."""
    pieces = round(to_m / side_m)
    rows, columns = (size // pieces for size in solid.shape)
    parts = solid[: rows * pieces, : columns * pieces].reshape(rows, pieces, columns, pieces)
    return np.asarray(parts.any(axis=(1, 3)), dtype=np.bool_)


def weights_with(shut: Obstacles, room_m: float, side_m: float = WAY_RESOLUTION_M) -> Weights:
    """Weights of coarse fields for a disc of this radius: obstacles where it does not fit."""
    return inflated(np.where(shut, OBSTACLE, FREE), room_m / side_m)


def cheapest_way(weights: Weights, start_m: Place, goal_m: Place, side_m: float = WAY_RESOLUTION_M) -> Way | None:
    """From field to field in eight directions; None if there is none."""
    problem = PlanningProblem(weights, _cell(start_m, side_m), _cell(goal_m, side_m))
    path = make_planner("astar", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
    if path is None:
        return None
    return (np.array([(cell.y, cell.x) for cell in path.cells]) + 0.5) * side_m


def shortest_m(weights: Weights, start_m: Place, goal_m: Place, side_m: float = WAY_RESOLUTION_M) -> float:
    """The length of the shortest way at any angle (Theta*), metres; NaN if there is none."""
    corners = any_angle(weights, _cell(start_m, side_m), _cell(goal_m, side_m), corner_cutting=False)
    return float(np.hypot(*np.diff(corners, axis=0).T).sum()) * side_m if len(corners) else float("nan")


def _cell(place_m: Place, side_m: float) -> Cell:
    return Cell(int(place_m[1] / side_m), int(place_m[0] / side_m))
