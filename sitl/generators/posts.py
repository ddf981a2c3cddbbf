"""Fields of posts as those of BARN: which cells of a lattice are filled, and posts in their middles.

Perille et al. 2020, "Benchmarking metric ground navigation", section II: a cellular automaton smooths what chance has
filled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.generators.canvas import EAST_M, FINE_M, NORTH_M, disc, empty
from sitl.world.world import Obstacles

Lattice = NDArray[np.bool_]
WEST_M = 10.0
"""No post stands within this of the west and the east edge."""


def lattice_shape(step_m: float, west_m: float) -> tuple[int, int]:
    """Rows and columns of the lattice between strips of ``west_m``."""
    return round(NORTH_M / step_m), round((EAST_M - 2.0 * west_m) / step_m)


def smooth(lattice: Lattice, rounds: int) -> Lattice:
    """After so many rounds: filled are cells with four filled ones of nine, and filled ones with two."""
    rows, columns = lattice.shape
    for _ in range(rounds):
        padded = np.pad(lattice, 1).astype(np.int8)
        near = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3))
        lattice = (near >= 4) | (lattice & (near >= 2))
    return lattice


def places_of(lattice: Lattice, step_m: float, west_m: float) -> NDArray[np.float64]:
    """Where the posts stand: metres north and east, shape (n, 2)."""
    corner_m = np.array((0.0, west_m))
    places_m: NDArray[np.float64] = (np.argwhere(lattice) + 0.5) * step_m + corner_m
    return places_m


def radius_of(step_m: float) -> float:
    """Of a post, metres."""
    return 0.25 * step_m + 0.5 * FINE_M


def stand(lattice: Lattice, step_m: float, west_m: float = WEST_M) -> Obstacles:
    """The posts as fields."""
    solid = empty()
    for north_m, east_m in places_of(lattice, step_m, west_m):
        disc(solid, north_m, east_m, radius_of(step_m))
    return solid
