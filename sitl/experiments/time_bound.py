"""The least time that a mission can take on ground that is known: what planning could gain at all.

Nouns: time bound.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import LocalFrame
from companion.core.grid import Cell
from companion.executive.mission_executor import MissionExecutor
from companion.mapping.distance_field import distance_field
from companion.mission.mission import Mission
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.scenario import Scenario

FINE_M = 0.25
"""Fields are no larger than this for it."""
UNKNOWN_S = 0.0
"""Where there is no bound: a target without a way, a patrol."""
Places = list[tuple[float, float]]


def time_bound_s(mission: Mission, scenario: Scenario, executor: MissionExecutor) -> float:
    """The shortest way at any angle (Theta*) from target to target at the mission's speeds, and the stays on the way.

    For a point in the middle of the rover that keeps half its width, among what stands and with all doors open; corners
    cost nothing. ``UNKNOWN_S`` where there is none.
    """
    progress = executor.progress
    if mission.patrol is not None:
        return UNKNOWN_S
    frame, start = LocalFrame(executor.layout.origin), scenario.start
    places = [start.place_of(frame.to_geo(target.point)) for target in progress.targets]
    legs_m = ways_m(scenario, [(start.north_m, start.east_m), *places])
    if legs_m is None:
        return UNKNOWN_S
    speeds_m_s = [target.speed_m_s or mission.rover.cruise_speed_m_s for target in progress.targets]
    stays_s = sum(target.hold_s for target in progress.targets[:-1])
    return math.fsum(leg_m / speed_m_s for leg_m, speed_m_s in zip(legs_m, speeds_m_s, strict=True)) + stays_s


def ways_m(scenario: Scenario, places: Places) -> list[float] | None:
    """Lengths of the shortest ways from place to place (north and east, world frame); None if one has none."""
    world = scenario.world
    if not world.obstacles.any():
        return [math.dist(*ends) for ends in pairwise(places)]
    pieces = max(1, math.ceil(world.resolution_m / FINE_M - 1e-9))
    side_m = world.resolution_m / pieces
    solid = world.obstacles.repeat(pieces, axis=0).repeat(pieces, axis=1)
    outline = scenario.outline
    half_width_m = outline.radius_m or outline.half_width_m
    # A field is free where a place in it may be: the bound must not be more than what can be driven.
    away_m = (distance_field(solid) - math.sqrt(2.0)) * side_m
    weights = np.where(away_m >= half_width_m - side_m, 0.5, 1.0)
    corner = (world.south_m, world.west_m)
    cells = [_cell(place, corner, side_m) for place in places]
    legs_m = [_leg_m(weights, one, two, side_m) for one, two in pairwise(cells)]
    known_m = [leg_m for leg_m in legs_m if leg_m is not None]
    return known_m if len(known_m) == len(legs_m) else None


def _cell(place: tuple[float, float], corner: tuple[float, float], side_m: float) -> Cell:
    return Cell(math.floor((place[1] - corner[1]) / side_m), math.floor((place[0] - corner[0]) / side_m))


def _leg_m(weights: NDArray[np.float64], start: Cell, target: Cell, side_m: float) -> float | None:
    problem = PlanningProblem(weights, start, target, corner_cutting=True)
    path = make_planner("theta-star", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
    if path is None:
        return None
    line = path.curve if path.curve is not None else np.array(path.cells, dtype=np.float64)
    return float(np.hypot(*np.diff(line, axis=0).T).sum()) * side_m
