"""Line of sight between fields, free samples, and shortening a chain of points in sight of each other. Compiled.

A line is drawn as by ``raster.polyline``, from its first point to its second.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from companion.core.grid import OBSTACLE, Weights
from companion.planning.random_numbers import State, whole
from companion.planning.raster import HALF, ONE, SHIFT, CellArray, fine_steps

DRAWS_A_SAMPLE = 50
"""Draws for each sample before it is given up. If a tenth of the ground is free, that hardly ever happens."""


@njit(cache=True, nogil=True)
def sees(weights: Weights, x0: int, y0: int, x1: int, y1: int, corner_cutting: bool) -> bool:
    """Whether the line from one field to another, both inside the map, touches no obstacle after its first field."""
    steps, step_x, step_y = fine_steps(x1 - x0, y1 - y0)
    fine_x, fine_y = x0 * ONE + HALF, y0 * ONE + HALF
    last_x, last_y = x0, y0
    for _ in range(steps):
        fine_x += step_x
        fine_y += step_y
        x, y = fine_x >> SHIFT, fine_y >> SHIFT
        if weights[y, x] >= OBSTACLE:
            return False
        if not corner_cutting and x != last_x and y != last_y:  # noqa: SIM102 - two simple conditions
            if weights[last_y, x] >= OBSTACLE or weights[y, last_x] >= OBSTACLE:
                return False
        last_x, last_y = x, y
    return True


@njit(cache=True, nogil=True)
def free_samples(weights: Weights, wanted: int, state: State) -> CellArray:
    """Free fields, uniformly at random, shape (n, 2): as many as wanted, or fewer where hardly any ground is free."""
    height, width = weights.shape
    samples = np.empty((wanted, 2), np.int64)
    used = 0
    for _ in range(wanted * DRAWS_A_SAMPLE):
        if used == wanted:
            break
        x, y = whole(state, 0, width - 1), whole(state, 0, height - 1)
        if weights[y, x] < OBSTACLE:
            samples[used, 0], samples[used, 1] = x, y
            used += 1
    return samples[:used]


@njit(cache=True, nogil=True)
def shortened(weights: Weights, points: CellArray, corner_cutting: bool) -> CellArray:
    """A shorter chain: each point is followed by the last of the later points in its sight. The ends stay.

    Each of the given points must see the next.
    """
    kept = np.empty_like(points)
    kept[0] = points[0]
    used, at = 1, 0
    while at < len(points) - 1:
        far = len(points) - 1
        while far > at + 1 and not sees(
            weights, points[at, 0], points[at, 1], points[far, 0], points[far, 1], corner_cutting
        ):
            far -= 1
        kept[used] = points[far]
        used += 1
        at = far
    return kept[:used].copy()
