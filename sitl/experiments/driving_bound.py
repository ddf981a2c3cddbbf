"""About the least time that physics allows a drive, whatever is planned.

Nouns: bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, inflated
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.lockstep import Drive
from sitl.world.world import World

FIELD_M = 0.25
"""Fields are no larger than this, nor than the world's own."""
ON_EDGE = 1e-6


def bound_s(run: Drive) -> float:
    """About the least time that physics allows: the shortest way at the mission's speeds, and the stays on it.

    The way is that of a disc as wide as the rover, by Theta* on fields of at most ``FIELD_M``, so it is known to about
    a field's diagonal at each bend. It ends where targets count as reached. Neither turning nor gathering speed takes
    time. Fences do not count. NaN where the mission has not begun, or where there is no way.
    """
    executor = run.companion.mission_run.executor
    if executor is None:
        return math.nan
    start, cruise_m_s = run.scenario.start, run.mission.rover.cruise_speed_m_s
    outline, arrival_m = run.scenario.outline, run.settings.guidance.arrival_m
    ways = shortest_ways_m(
        run.scenario.world,
        [
            (start.north_m, start.east_m),
            *(
                (start.north_m + target.point.north_m, start.east_m + target.point.east_m)
                for target in executor.progress.targets
            ),
        ],
        outline.radius_m or outline.half_width_m,
    )
    total_s = 0.0
    for number, (way_m, target) in enumerate(zip(ways, executor.progress.targets, strict=True)):
        own_m = max(way_m - arrival_m * (1.0 if number == 0 else 2.0), 0.0)
        total_s += own_m / (target.speed_m_s or cruise_m_s)
    return total_s + sum(target.hold_s for target in executor.progress.targets[:-1])


def shortest_ways_m(world: World, places: list[tuple[float, float]], half_m: float) -> list[float]:
    """The shortest way of a disc from each place to the next; NaN where there is none.

    ``places``: metres north and east, world frame; ``half_m``: the disc's radius.
    """
    ground = _Ground(world, places, half_m)
    return [ground.way_m(*ends) for ends in pairwise(places)]


class _Ground:
    """The world's obstacles on fine fields, grown by the rover. Beyond the world it reaches as far as the places."""

    def __init__(self, world: World, places: list[tuple[float, float]], half_m: float) -> None:
        pieces = max(1, math.ceil(world.resolution_m / FIELD_M - ON_EDGE))
        self._field_m = world.resolution_m / pieces
        solid = np.kron(world.layers().solid.fields, np.ones((pieces, pieces), np.bool_))
        (south, north), (west, east) = (
            _beyond(along, edge_m, size, self._field_m)
            for along, edge_m, size in zip(
                zip(*places, strict=True), (world.south_m, world.west_m), solid.shape, strict=True
            )
        )
        self._south_m, self._west_m = world.south_m - south * self._field_m, world.west_m - west * self._field_m
        weights = np.where(np.pad(solid, ((south, north), (west, east))), OBSTACLE, BASE_WEIGHT)
        # A place on the way may lie half a diagonal from the middle of its field.
        self._weights = inflated(weights, max(half_m / self._field_m - math.sqrt(0.5), 0.0))

    def way_m(self, start_m: tuple[float, float], target_m: tuple[float, float]) -> float:
        """The shortest way, any angle; NaN where there is none."""
        start, target = (
            Cell(
                math.floor((east_m - self._west_m) / self._field_m),
                math.floor((north_m - self._south_m) / self._field_m),
            )
            for north_m, east_m in (start_m, target_m)
        )
        if start == target:
            return math.dist(start_m, target_m)
        problem = PlanningProblem(self._weights, start, target)
        path = make_planner("theta-star", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
        if path is None or path.curve is None:
            return math.nan
        return self._field_m * float(np.hypot(*np.diff(path.curve, axis=0).T).sum())


def _beyond(along_m: Iterable[float], edge_m: float, size: int, field_m: float) -> tuple[int, int]:
    """How many fields the places lie before the world's edge, and behind its other one."""
    fields = [math.floor((place_m - edge_m) / field_m) for place_m in along_m]
    return max(0, -min(fields)), max(0, max(fields) - size + 1)
