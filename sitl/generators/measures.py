"""How difficult a ground is: five measures along its shortest way (Perille et al. 2020, "Benchmarking metric ground
navigation", section III).

Nouns: difficulty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.mapping.distance_field import distance_field
from sitl.world.world import Obstacles

RAYS = 16
REACH_M = 8.0
"""No ray is longer."""
LOOKS = 60
"""So many places of the way are looked at."""


@dataclass(frozen=True, slots=True)
class Difficulty:
    """Means over the way, but for tortuosity."""

    closest_wall_m: float
    """Distance to the nearest obstacle."""
    visibility_m: float
    """Length of rays to all sides."""
    dispersion: float
    """Changes from free to shut ground from ray to ray, of 16."""
    characteristic_m: float
    """The shortest line through the place from obstacle to obstacle."""
    tortuosity: float
    """Length of the shortest way at any angle over the distance of its ends."""


def measured(solid: Obstacles, side_m: float, way_m: NDArray[np.float64], length_m: float) -> Difficulty:
    """Of ground as it stands, without what moves.

    ``solid``: fields of ``side_m``, shape (height, width). ``way_m``: the shortest way, north and east, shape (n, 2).
    ``length_m``: of the shortest way at any angle between the same ends.
    """
    way = way_m[:: max(1, len(way_m) // LOOKS)]
    away_m = distance_field(solid) * side_m
    rows, columns = (way / side_m).astype(np.int64).T
    rays_m = np.array([_rays(solid, side_m, place) for place in way])
    shut = rays_m < 0.5 * REACH_M
    through_m = rays_m[:, : RAYS // 2] + rays_m[:, RAYS // 2 :]
    return Difficulty(
        float(away_m[rows, columns].mean()),
        float(rays_m.mean()),
        float((shut != np.roll(shut, 1, axis=1)).sum(axis=1).mean()),
        float(through_m.min(axis=1).mean()),
        length_m / math.hypot(*(way_m[-1] - way_m[0])),
    )


def _rays(solid: NDArray[np.bool_], side_m: float, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lengths of rays to all sides, clockwise from north."""
    at_m = np.arange(0.5 * side_m, REACH_M, 0.5 * side_m)
    bearings = np.arange(RAYS) * 2.0 * np.pi / RAYS
    norths = ((place[0] + np.cos(bearings)[:, None] * at_m) / side_m).astype(np.int64)
    easts = ((place[1] + np.sin(bearings)[:, None] * at_m) / side_m).astype(np.int64)
    inside = (norths >= 0) & (norths < solid.shape[0]) & (easts >= 0) & (easts < solid.shape[1])
    met = ~inside | solid[np.clip(norths, 0, solid.shape[0] - 1), np.clip(easts, 0, solid.shape[1] - 1)]
    return np.where(met.any(axis=1), at_m[met.argmax(axis=1)], REACH_M)
