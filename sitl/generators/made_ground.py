"""A world of a kind from a seed, with places to drive from and to, between which there is a way.

Nouns: made ground.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, inflated
from companion.core.own_parts import OwnKind, OwnPartError, blamed
from companion.mission.mission import HomePoint, MoverSpec
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.generators.canvas import EAST_M, FINE_M, NORTH_M, empty, free
from sitl.generators.kinds import Parameters, parameters_of, stream_of
from sitl.world.world import Obstacles, World
from sitl.world.world_file import movers_of

BODY_M = 0.6
"""Everywhere there is a way with so much room on both sides."""
END_M = 4.0
"""Nothing stands within this of the two ends."""
WAY_RESOLUTION_M = 0.2
MOST_DRAWN = 60
GROUND_STREAM, MOVER_STREAM = 51, 52
ROOM_M, WALL_M = 7.0, 1.0
"""Nothing moves within these of the west and the east edge, and of the others."""


class NoWayError(ValueError):
    """Parameters with which there is no ground with a way; the text is one line."""


@dataclass(frozen=True, eq=False)
class MadeGround:
    """A world, and where to drive from and to: metres north and east. There is a way.

    ``way_m``: the shortest on fields of ``WAY_RESOLUTION_M``, shape (n, 2), north and east.
    """

    kind: str
    world: World
    start_m: tuple[float, float]
    goal_m: tuple[float, float]
    way_m: NDArray[np.float64]
    movers: tuple[MoverSpec, ...] = ()


def made(kind: str, seed: int, given: Parameters | None = None, movers: int = 0) -> MadeGround:
    """The ground of a seed; drawn again until there is a way for a disc of ``BODY_M``.

    ``given``: the kind's parameters; None: as they are without a word. ``movers``: things that drive to and fro.
    Raises NoWayError, and OwnPartError for a kind of one's own that draws no ground.
    """
    parameters = given or parameters_of(kind)()
    rng = np.random.default_rng([seed, stream_of(kind), GROUND_STREAM])
    for _ in range(MOST_DRAWN):
        with blamed(OwnKind.WORLD, kind):
            solid = parameters.draw(rng)
        if not isinstance(solid, np.ndarray):
            raise OwnPartError(f"world {kind!r:.80} draws {type(solid).__name__}; begin with empty(), and return it")
        if solid.shape != empty().shape or solid.dtype != np.bool_:
            raise OwnPartError(f"world {kind!r:.80} draws {solid.dtype} of shape {solid.shape}; begin with empty()")
        start_m = float(rng.uniform(END_M, NORTH_M - END_M)), 3.0
        goal_m = float(rng.uniform(END_M, NORTH_M - END_M)), EAST_M - 3.0
        for north_m, east_m in (start_m, goal_m):
            free(solid, north_m - 1.5, east_m - 1.5, 3.0, 3.0)
        solid[[0, -1], :] = True
        solid[:, [0, -1]] = True
        way_m = _way(solid, start_m, goal_m)
        if way_m is not None:
            ground = MadeGround(kind, World(solid, FINE_M), start_m, goal_m, way_m)
            specs = _movers(ground, seed, movers)
            return replace(ground, movers=specs, world=World(solid, FINE_M, movers=movers_of(list(specs), start_m)))
    raise NoWayError(f"{kind}: with these parameters none of {MOST_DRAWN} grounds has a way; make it less dense")


def _way(solid: Obstacles, start_m: tuple[float, float], goal_m: tuple[float, float]) -> NDArray[np.float64] | None:
    pieces = round(WAY_RESOLUTION_M / FINE_M)
    rows, columns = (size // pieces for size in solid.shape)
    coarse = solid.reshape(rows, pieces, columns, pieces).any(axis=(1, 3))
    weights = inflated(np.where(coarse, OBSTACLE, 0.5), BODY_M / WAY_RESOLUTION_M)
    start, goal = (
        Cell(int(east_m / WAY_RESOLUTION_M), int(north_m / WAY_RESOLUTION_M)) for north_m, east_m in (start_m, goal_m)
    )
    planner = make_planner("astar", PlannerSettings())
    path = planner.plan(PlanningProblem(weights, start, goal), Budget(), np.random.default_rng(0)).path
    if path is None:
        return None
    return (np.array([(cell.y, cell.x) for cell in path.cells]) + 0.5) * WAY_RESOLUTION_M


def _movers(ground: MadeGround, seed: int, count: int) -> tuple[MoverSpec, ...]:
    """Discs that cross the way to and fro; they pass through what stands, and announce nothing."""
    rng = np.random.default_rng([seed, stream_of(ground.kind), MOVER_STREAM])
    movers = []
    for number in range(1, count + 1):
        north_m, east_m = ground.way_m[int(rng.uniform(0.2, 0.8) * (len(ground.way_m) - 1))]
        bearing_rad, far_m = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(3.0, 8.0)
        aside_m = far_m * np.array((np.cos(bearing_rad), np.sin(bearing_rad)))
        route = tuple(_from_start(ground, (north_m, east_m) + sign * aside_m) for sign in (-1.0, 1.0))
        radius_m, speed_m_s = round(rng.uniform(0.2, 0.5), 2), round(rng.uniform(0.3, 1.2), 2)
        movers.append(MoverSpec(f"mover {number}", radius_m, speed_m_s, route, repeat=True))
    return tuple(movers)


def _from_start(ground: MadeGround, place_m: NDArray[np.float64]) -> HomePoint:
    """A place in metres from the start; it lies within the walls, and not near the west and the east side."""
    north_m = min(max(float(place_m[0]), WALL_M), NORTH_M - WALL_M)
    east_m = min(max(float(place_m[1]), ROOM_M), EAST_M - ROOM_M)
    return HomePoint(round(north_m - ground.start_m[0], 2), round(east_m - ground.start_m[1], 2))
