"""Calls of the planner by the navigator: the budget for each kind of search, kinematic constraints, the time they took.

Nouns: path searcher.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from companion.core.clock import stopwatch_s
from companion.core.frames import Pose, wrap_pi_rad
from companion.core.grid import OBSTACLE, Cell, Grid, Weights
from companion.core.own_parts import OwnKind, blamed
from companion.core.rover_limits import RoverLimits
from companion.navigation.field_step import SearchKind
from companion.planning.planner import Planner
from companion.planning.problem import Budget, KinematicConstraints, ObstacleTrajectory, PlanningProblem, PlanResult
from companion.settings import NavigatorSettings, SearchSettings, Settings

START_WEIGHT = 0.9
"""The weight of the start if the map has an obstacle there."""


def budget_of(settings: SearchSettings) -> Budget:
    """The planner's budget for one kind of search."""
    return Budget(settings.min_epochs, settings.max_epochs, settings.control_points, settings.population)


def kinematics_of(
    pose: Pose, rover: RoverLimits, fastest_m_s: float, settings: Settings, grid: Grid
) -> KinematicConstraints:
    """How the rover can move, for a planner: its heading, its turning radius and the range of speeds, in fields."""
    fastest_m_s = min(fastest_m_s, settings.guidance.max_speed_m_s)
    slowest_m_s = min(settings.guidance.min_speed_m_s, fastest_m_s)
    return KinematicConstraints(
        heading_rad=wrap_pi_rad(0.5 * math.pi - pose.heading_rad),
        turning_radius_fields=grid.fields(rover.turning_radius_m * settings.steering.planned_radius),
        speeds_fields_s=(grid.fields(slowest_m_s), grid.fields(fastest_m_s)),
    )


@dataclass
class PathSearcher:
    """Calls the planner with the budget for each kind of search. ``seconds``: how long each search took.

    ``by_curves``: how many were answered by a curve of the genetic algorithm, and not by a graph search.
    """

    planner: Planner
    rng: Generator
    seconds: list[float] = field(default_factory=list)
    by_curves: int = 0

    def search(
        self,
        weights: Weights,
        kind: SearchKind,
        start: Cell,
        target: Cell,
        settings: NavigatorSettings,
        moving_obstacles: tuple[ObstacleTrajectory, ...] = (),
        kinematics: KinematicConstraints = KinematicConstraints(),  # noqa: B008 - frozen
    ) -> PlanResult:
        """One search over ``weights``, which are not changed.

        The start is treated as free even if the map has an obstacle there, because the rover is in it. Raises
        OwnPartError for a planner of one's own that fails.
        """
        began_s = stopwatch_s()
        if weights[start.y, start.x] >= OBSTACLE:
            weights = np.array(weights)
            weights[start.y, start.x] = START_WEIGHT
        budget = budget_of(settings.thorough if kind is SearchKind.THOROUGH else settings.quick)
        problem = PlanningProblem(weights, start, target, moving_obstacles=moving_obstacles, kinematics=kinematics)
        with blamed(OwnKind.PLANNER, settings.planner):
            result = self.planner.plan(problem, budget, self.rng)
        self.seconds.append(stopwatch_s() - began_s)
        self.by_curves += result.path is not None and result.control_points > 0
        return result
