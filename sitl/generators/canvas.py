"""Drawing on the fields of a world: rectangles, discs, walls with gaps; all in metres from the south-west corner."""

from __future__ import annotations

import math

import numpy as np

from sitl.world.world import Obstacles

NORTH_M, EAST_M = 32.0, 44.0
"""How large made worlds are."""
FINE_M = 0.1
"""Side of a field."""


def empty() -> Obstacles:
    """Fields without an obstacle, shape (height, width)."""
    return np.zeros((round(NORTH_M / FINE_M), round(EAST_M / FINE_M)), dtype=np.bool_)


def area(south_m: float, west_m: float, height_m: float, width_m: float) -> tuple[slice, slice]:
    """The fields of a rectangle."""
    return (
        slice(max(0, round(south_m / FINE_M)), max(0, round((south_m + height_m) / FINE_M))),
        slice(max(0, round(west_m / FINE_M)), max(0, round((west_m + width_m) / FINE_M))),
    )


def fill(solid: Obstacles, south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    """Put an obstacle on a rectangle."""
    solid[area(south_m, west_m, height_m, width_m)] = True


def free(solid: Obstacles, south_m: float, west_m: float, height_m: float, width_m: float) -> None:
    """Take all obstacles from a rectangle."""
    solid[area(south_m, west_m, height_m, width_m)] = False


def disc(solid: Obstacles, north_m: float, east_m: float, radius_m: float) -> None:
    """Put a round obstacle down."""
    reach_m = radius_m + FINE_M
    near = area(north_m - reach_m, east_m - reach_m, 2.0 * reach_m, 2.0 * reach_m)
    rows, columns = (np.arange(*part.indices(size)) for part, size in zip(near, solid.shape, strict=True))
    north_to_m, east_to_m = (rows + 0.5) * FINE_M - north_m, (columns + 0.5) * FINE_M - east_m
    solid[near] |= np.hypot(north_to_m[:, None], east_to_m[None, :]) < radius_m


def with_ends(solid: Obstacles, *ends_m: tuple[float, float]) -> Obstacles:
    """The same ground: nothing stands at its ends, and its edges are shut."""
    for north_m, east_m in ends_m:
        free(solid, north_m - 1.5, east_m - 1.5, 3.0, 3.0)
    solid[[0, -1], :] = True
    solid[:, [0, -1]] = True
    return solid


def wall(
    solid: Obstacles,
    rng: np.random.Generator,
    south_m: float,
    west_m: float,
    long_m: float,
    gaps_m: tuple[float, float],
    *,
    along_north: bool,
) -> None:
    """A wall of 0.2 m with one gap, and one more for each 12 m of a chance length; ``gaps_m``: least and most width."""
    fill(solid, south_m, west_m, *((long_m, 0.2) if along_north else (0.2, long_m)))
    for _ in range(1 + math.floor(rng.uniform(0.0, long_m) / 12.0)):
        wide_m = float(rng.uniform(*gaps_m))
        at_m = float(rng.uniform(0.8, max(long_m - wide_m - 0.8, 0.9)))
        if along_north:
            free(solid, south_m + at_m, west_m, wide_m, 0.2)
        else:
            free(solid, south_m, west_m + at_m, 0.2, wide_m)
