"""Random ground inside walls, with places that a rover can certainly reach and places that it certainly cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from companion.core.grid import OBSTACLE, Cell, inflated
from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, SitlSpec, Target
from sitl.world.world import Obstacles, World

WIDTH_M, HEIGHT_M = 60, 44
FINE_M = 0.5
"""The world's fields are half as large as the mission's and lie anywhere to them."""
ROOM_M = 1.6
"""Certainly reachable: there is a way with so much room on both sides."""
KINDS = ("clutter", "rooms", "traps", "posts")
SEALED_SHARE = 0.25
"""In so many missions one target lies where no way leads."""
FAR_M = 12.0


@dataclass(frozen=True, eq=False)
class Ground:
    """A world, the rover's place in it (metres north and east), and places to send it to."""

    kind: str
    world: World
    start_m: tuple[float, float]
    reachable_m: tuple[tuple[float, float], ...]
    sealed_m: tuple[float, float] | None


def drawn(rng: np.random.Generator) -> Ground:
    """A ground with two or three places that can be reached from its start; drawn again until there are."""
    while True:
        kind = KINDS[rng.integers(len(KINDS))]
        solid = _walled(_MAKERS[kind](rng))
        sealed = _sealed(solid, rng) if rng.random() < SEALED_SHARE else None
        roomy = inflated(np.where(solid, OBSTACLE, 0.0), ROOM_M / FINE_M) < OBSTACLE
        starts = np.argwhere(roomy[:, : int(8 / FINE_M)])
        if not starts.size:
            continue
        row, column = starts[rng.integers(len(starts))]
        places = _places(_joined(roomy, row, column), (row, column), rng)
        if len(places) >= 2:
            rough, slippery = _patches(rng), _patches(rng)
            ground = _layers(solid.shape, rough, slippery)
            return Ground(kind, World(solid, FINE_M, ground=ground), _middle(row, column), tuple(places), sealed)


def mission_on(ground: Ground, sensors: str, name: str, rng: np.random.Generator) -> Mission:
    """The targets in a random order of the reachable, the other one anywhere among them."""
    targets = [_target(f"target {n}", place, ground.start_m) for n, place in enumerate(ground.reachable_m, 1)]
    if ground.sealed_m is not None:
        targets.insert(int(rng.integers(len(targets) + 1)), _target("sealed", ground.sealed_m, ground.start_m))
    north_m, east_m = ground.start_m
    home = Cell(int(east_m), int(north_m))
    heading_deg = float(rng.uniform(0.0, 360.0))
    grid = GridSpec(1.0, (WIDTH_M, HEIGHT_M), home)
    return Mission(name, tuple(targets), grid, sitl=SitlSpec(heading_deg=heading_deg, sensors=sensors))


def _target(name: str, place_m: tuple[float, float], start_m: tuple[float, float]) -> Target:
    return Target(name, HomePoint(place_m[0] - start_m[0], place_m[1] - start_m[1]), 0.0, OnBlocked.SKIP)


def _places(within: Obstacles, start: tuple[int, int], rng: np.random.Generator) -> list[tuple[float, float]]:
    """Two or three places of the set, far from the start and from one another."""
    wanted, fields = int(rng.integers(2, 4)), rng.permutation(np.argwhere(within))
    chosen = [_middle(*start)]
    for row, column in fields:
        place = _middle(row, column)
        if all(np.hypot(place[0] - other[0], place[1] - other[1]) > FAR_M for other in chosen):
            chosen.append(place)
        if len(chosen) > wanted:
            break
    return chosen[1:]


def _middle(row: int, column: int) -> tuple[float, float]:
    return (float(row) + 0.5) * FINE_M, (float(column) + 0.5) * FINE_M


def _joined(free: Obstacles, row: int, column: int) -> Obstacles:
    """The free fields that this one is joined to, sides touching."""
    joined, grown = np.zeros_like(free), True
    joined[row, column] = True
    while grown:
        before = joined.sum()
        joined[1:] |= joined[:-1]
        joined[:-1] |= joined[1:]
        joined[:, 1:] |= joined[:, :-1]
        joined[:, :-1] |= joined[:, 1:]
        joined &= free
        grown = joined.sum() > before
    return joined


def _empty() -> Obstacles:
    return np.zeros((int(HEIGHT_M / FINE_M), int(WIDTH_M / FINE_M)), dtype=np.bool_)


def _walled(solid: Obstacles) -> Obstacles:
    solid[[0, -1], :] = True
    solid[:, [0, -1]] = True
    return solid


def _fill(solid: Obstacles, south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    rows, columns = slice(_index(south_m), _index(south_m + height_m)), slice(_index(west_m), _index(west_m + width_m))
    solid[rows, columns] = True


def _index(metres: float) -> int:
    return max(0, round(metres / FINE_M))


def _clutter(rng: np.random.Generator) -> Obstacles:
    solid = _empty()
    for _ in range(int(rng.integers(10, 26))):
        _fill(solid, *rng.uniform((0.0, 6.0), (HEIGHT_M, WIDTH_M)), *rng.uniform(1.0, 6.0, 2))
    return solid


def _rooms(rng: np.random.Generator) -> Obstacles:
    """Walls from side to side with a door or two in each."""
    solid = _empty()
    for east_m in np.arange(14.0, WIDTH_M - 8.0, rng.uniform(11.0, 16.0)):
        _fill(solid, 0.0, east_m, HEIGHT_M, 0.5)
        for north_m in rng.uniform(1.0, HEIGHT_M - 6.0, int(rng.integers(1, 3))):
            solid[_index(north_m) : _index(north_m + rng.uniform(3.5, 6.0)), _index(east_m) : _index(east_m + 0.5)] = (
                False
            )
    return solid


def _traps(rng: np.random.Generator) -> Obstacles:
    """Three walls each, open to any side."""
    solid = _empty()
    for _ in range(int(rng.integers(3, 7))):
        south_m, west_m = rng.uniform((2.0, 9.0), (HEIGHT_M - 12.0, WIDTH_M - 12.0))
        height_m, width_m = rng.uniform(6.0, 11.0, 2)
        sides = (
            (south_m, west_m, height_m, 0.5), (south_m, west_m + width_m, height_m, 0.5),
            (south_m, west_m, 0.5, width_m), (south_m + height_m, west_m, 0.5, width_m + 0.5),
        )  # fmt: skip
        open_side = int(rng.integers(4))
        for number, side in enumerate(sides):
            if number != open_side:
                _fill(solid, *side)
    return solid


def _posts(rng: np.random.Generator) -> Obstacles:
    """Round things from a post to a tank."""
    solid = _empty()
    norths_m, easts_m = np.ogrid[: solid.shape[0], : solid.shape[1]]
    for _ in range(int(rng.integers(12, 30))):
        north_m, east_m = rng.uniform((0.0, 6.0), (HEIGHT_M, WIDTH_M))
        far_m = np.hypot((norths_m + 0.5) * FINE_M - north_m, (easts_m + 0.5) * FINE_M - east_m)
        solid |= far_m < rng.uniform(0.3, 2.5)
    return solid


_MAKERS = {"clutter": _clutter, "rooms": _rooms, "traps": _traps, "posts": _posts}


def _sealed(solid: Obstacles, rng: np.random.Generator) -> tuple[float, float]:
    """Builds a box somewhere and gives the place in its middle."""
    south_m, west_m = rng.uniform((2.0, 14.0), (HEIGHT_M - 9.0, WIDTH_M - 9.0))
    _fill(solid, south_m, west_m, 6.5, 6.5)
    solid[_index(south_m + 0.5) : _index(south_m + 6.0), _index(west_m + 0.5) : _index(west_m + 6.0)] = False
    return south_m + 3.25, west_m + 3.25


def _patches(rng: np.random.Generator) -> list[shapely.Polygon]:
    """None to two discs of other ground."""
    return [
        shapely.Point(*rng.uniform((8.0, 0.0), (WIDTH_M, HEIGHT_M))).buffer(rng.uniform(2.0, 5.0))
        for _ in range(rng.integers(3))
    ]


def _layers(
    shape: tuple[int, ...], rough: list[shapely.Polygon], slippery: list[shapely.Polygon]
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Grip and share of speed of every field, as the world wants them."""
    ground = np.ones((2, *shape), dtype=np.float32)
    norths_m, easts_m = np.mgrid[: shape[0], : shape[1]] * FINE_M + FINE_M / 2
    for layer, patches, value in ((0, slippery, 0.3), (1, rough, 0.4)):
        for patch in patches:
            ground[layer][shapely.contains_xy(patch, easts_m, norths_m)] = value
    return ground
