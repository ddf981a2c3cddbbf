"""A world of a kind from a seed, with places to drive from and to, between which there is a way.

Nouns: made ground.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from companion.core.own_parts import OwnKind, OwnPartError, blamed
from companion.mission.mission import HomePoint, MoverSpec
from sitl.generators.canvas import EAST_M, FINE_M, NORTH_M, empty, with_ends
from sitl.generators.kinds import Parameters, parameters_of, stream_of
from sitl.generators.measures import Difficulty, measured
from sitl.generators.shortest_way import BODY_M, cheapest_way, coarse, shortest_m, weights_with
from sitl.world.world import World
from sitl.world.world_file import movers_of

END_M = 4.0
"""Nothing stands within this of the two ends."""
START_EAST_M = 3.0
ACROSS_M = EAST_M - 2.0 * START_EAST_M
"""From the start east to the target, without a word."""
NEAREST_TARGET_M = 6.0
MOST_DRAWN = 60
GROUND_STREAM, MOVER_STREAM = 51, 52
ROOM_M, WALL_M = 7.0, 1.0
"""Nothing moves within these of the west and the east edge, and of the others."""


class NoWayError(ValueError):
    """Parameters with which there is no ground with a way; the text is one line."""


@dataclass(frozen=True, eq=False)
class MadeGround:
    """A world, and where to drive from and to: metres north and east. There is a way.

    ``way_m``: the shortest on fields of ``WAY_RESOLUTION_M``, shape (n, 2), north and east; it keeps ``room_m`` on both
    sides.
    """

    kind: str
    world: World
    start_m: tuple[float, float]
    goal_m: tuple[float, float]
    way_m: NDArray[np.float64]
    movers: tuple[MoverSpec, ...] = ()
    room_m: float = BODY_M

    @cached_property
    def difficulty(self) -> Difficulty:
        """Of the ground as it stands, without what moves; worked out when first asked for."""
        solid, side_m = self.world.obstacles, self.world.resolution_m
        weights = weights_with(coarse(solid, side_m), self.room_m)
        return measured(solid, side_m, self.way_m, shortest_m(weights, self.start_m, self.goal_m))


def made(
    kind: str, seed: int, given: Parameters | None = None, movers: int = 0, target_east_m: float = ACROSS_M
) -> MadeGround:
    """The ground of a seed; drawn again until there is a way with the kind's room on both sides.

    ``given``: the kind's parameters; None: as they are without a word. ``movers``: things that drive to and fro.
    ``target_east_m``: so far east of the start the target lies, and at most as far to its side.
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
        start_m = float(rng.uniform(END_M, NORTH_M - END_M)), START_EAST_M
        goal_north_m = float(rng.uniform(END_M, NORTH_M - END_M))
        goal_north_m = min(max(goal_north_m, start_m[0] - target_east_m), start_m[0] + target_east_m)
        goal_m = goal_north_m, START_EAST_M + target_east_m
        with blamed(OwnKind.WORLD, kind):
            solid = with_ends(parameters.between(solid, start_m, goal_m, rng), start_m, goal_m)
        way_m = cheapest_way(weights_with(coarse(solid), parameters.beside_m), start_m, goal_m)
        if way_m is not None:
            ground = MadeGround(kind, World(solid, FINE_M), start_m, goal_m, way_m, room_m=parameters.beside_m)
            specs = _movers(ground, seed, movers)
            return replace(ground, movers=specs, world=World(solid, FINE_M, movers=movers_of(list(specs), start_m)))
    raise NoWayError(f"{kind}: with these parameters none of {MOST_DRAWN} grounds has a way; make it less dense")


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
