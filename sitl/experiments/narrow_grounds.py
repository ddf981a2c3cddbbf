"""Random ground in which the way is narrow in places: clutter, rooms with doors, a yard with fences and gates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from companion.core.grid import OBSTACLE, Cell, inflated
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.world.world import Obstacles, World

NORTH_M, EAST_M = 32.0, 44.0
FINE_M = 0.1
BODY_M = 0.6
"""Everywhere there is a way with so much room on both sides."""
END_M = 4.0
"""Nothing stands within this of the two ends."""
WAY_RESOLUTION_M = 0.2


class GroundKind(StrEnum):
    """What the ground is like."""

    CLUTTER = "clutter"
    """Boxes and posts."""
    ROOMS = "rooms"
    """Walls of a building, with doors of 1.3 to 2 m."""
    YARD = "yard"
    """Fences across the way with one or two gates of 1.3 to 2 m, and containers."""


@dataclass(frozen=True, eq=False)
class NarrowGround:
    """A world, and where to drive from and to: metres north and east. There is a way."""

    kind: GroundKind
    world: World
    start_m: tuple[float, float]
    goal_m: tuple[float, float]


def drawn(kind: GroundKind, seed: int) -> NarrowGround:
    """The ground of a seed; drawn again until there is a way for a disc of ``BODY_M``."""
    rng = np.random.default_rng([seed, list(GroundKind).index(kind), 51])
    while True:
        solid = _MAKERS[kind](rng)
        start_m = float(rng.uniform(END_M, NORTH_M - END_M)), 3.0
        goal_m = float(rng.uniform(END_M, NORTH_M - END_M)), EAST_M - 3.0
        for north_m, east_m in (start_m, goal_m):
            _free(solid, north_m - 1.5, east_m - 1.5, 3.0, 3.0)
        solid[[0, -1], :] = True
        solid[:, [0, -1]] = True
        if _has_way(solid, start_m, goal_m):
            return NarrowGround(kind, World(solid, FINE_M), start_m, goal_m)


def _has_way(solid: Obstacles, start_m: tuple[float, float], goal_m: tuple[float, float]) -> bool:
    pieces = round(WAY_RESOLUTION_M / FINE_M)
    rows, columns = (size // pieces for size in solid.shape)
    coarse = solid.reshape(rows, pieces, columns, pieces).any(axis=(1, 3))
    weights = inflated(np.where(coarse, OBSTACLE, 0.5), BODY_M / WAY_RESOLUTION_M)
    start, goal = (
        Cell(int(east_m / WAY_RESOLUTION_M), int(north_m / WAY_RESOLUTION_M)) for north_m, east_m in (start_m, goal_m)
    )
    planner = make_planner("astar", PlannerSettings())
    return planner.plan(PlanningProblem(weights, start, goal), Budget(), np.random.default_rng(0)).path is not None


def _empty() -> Obstacles:
    return np.zeros((round(NORTH_M / FINE_M), round(EAST_M / FINE_M)), dtype=np.bool_)


def _area(south_m: float, west_m: float, height_m: float, width_m: float) -> tuple[slice, slice]:
    return (
        slice(max(0, round(south_m / FINE_M)), max(0, round((south_m + height_m) / FINE_M))),
        slice(max(0, round(west_m / FINE_M)), max(0, round((west_m + width_m) / FINE_M))),
    )


def _fill(solid: Obstacles, south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    solid[_area(south_m, west_m, height_m, width_m)] = True


def _free(solid: Obstacles, south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    solid[_area(south_m, west_m, height_m, width_m)] = False


def _clutter(rng: np.random.Generator) -> Obstacles:
    solid = _empty()
    norths_m, easts_m = ((np.arange(size) + 0.5) * FINE_M for size in solid.shape)
    for _ in range(int(rng.integers(90, 150))):
        north_m, east_m = rng.uniform((0.0, 6.0), (NORTH_M, EAST_M - 6.0))
        if rng.random() < 0.5:
            _fill(solid, north_m, east_m, *rng.uniform(0.4, 2.5, 2))
        else:
            radius_m = rng.uniform(0.15, 1.0)
            solid |= np.hypot(norths_m[:, None] - north_m, easts_m[None, :] - east_m) < radius_m
    return solid


def _rooms(rng: np.random.Generator) -> Obstacles:
    """Halved again and again by walls, each with a door or two, until rooms are 4 to 9 m wide."""
    solid = _empty()
    areas = [(0.0, 5.0, NORTH_M, EAST_M - 10.0)]
    _wall(solid, rng, 0.0, 5.0, NORTH_M, along_north=True)
    _wall(solid, rng, 0.0, EAST_M - 5.0, NORTH_M, along_north=True)
    while areas:
        south_m, west_m, height_m, width_m = areas.pop()
        if max(height_m, width_m) < 9.0:
            continue
        share = rng.uniform(0.4, 0.6)
        if height_m > width_m:
            cut_m = share * height_m
            _wall(solid, rng, south_m + cut_m, west_m, width_m, along_north=False)
            areas += [(south_m, west_m, cut_m, width_m), (south_m + cut_m, west_m, height_m - cut_m, width_m)]
        else:
            cut_m = share * width_m
            _wall(solid, rng, south_m, west_m + cut_m, height_m, along_north=True)
            areas += [(south_m, west_m, height_m, cut_m), (south_m, west_m + cut_m, height_m, width_m - cut_m)]
    return solid


def _yard(rng: np.random.Generator) -> Obstacles:
    solid = _empty()
    east_m = float(rng.uniform(8.0, 11.0))
    while east_m < EAST_M - 7.0:
        _wall(solid, rng, 0.0, east_m, NORTH_M, along_north=True)
        following_m = east_m + float(rng.uniform(7.0, 11.0))
        for _ in range(int(rng.integers(1, 4))):
            south_m, west_m = rng.uniform((0.0, east_m + 2.5), (NORTH_M - 6.0, east_m + 4.0))
            height_m, width_m = (2.4, 1.2) if rng.random() < 0.5 else (6.0, 2.4)
            _fill(solid, south_m, west_m, height_m, width_m)
        east_m = following_m
    return solid


def _wall(
    solid: Obstacles, rng: np.random.Generator, south_m: float, west_m: float, long_m: float, *, along_north: bool
) -> None:
    """A wall of 0.2 m with one or two gaps."""
    _fill(solid, south_m, west_m, *((long_m, 0.2) if along_north else (0.2, long_m)))
    for _ in range(1 + math.floor(rng.uniform(0.0, long_m) / 12.0)):
        wide_m = float(rng.uniform(1.3, 2.0))
        at_m = float(rng.uniform(0.8, max(long_m - wide_m - 0.8, 0.9)))
        if along_north:
            _free(solid, south_m + at_m, west_m, wide_m, 0.2)
        else:
            _free(solid, south_m, west_m + at_m, 0.2, wide_m)


_MAKERS = {GroundKind.CLUTTER: _clutter, GroundKind.ROOMS: _rooms, GroundKind.YARD: _yard}
