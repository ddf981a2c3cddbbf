"""Prior map: known obstacles and weights, copied onto the mission's grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Grid

EDGE = 1e-6
"""Fields that overlap by less than this share of a map's field count as neighbours: rounding errors."""

Indices = NDArray[np.int64]


def stamp_prior(grid: Grid, prior: Grid) -> Grid:
    """``grid`` with the content of ``prior``; both in one frame, with fields of any size.

    A field is an obstacle if any obstacle of the map overlaps it; otherwise it gets the weight of the map's field at
    its middle. Fields outside the map keep their weight.
    """
    scale = grid.resolution_m / prior.resolution_m
    low_x, high_x, middle_x = _spans(
        grid.width, grid.south_west.east_m - prior.south_west.east_m, scale, prior.width, prior
    )
    low_y, high_y, middle_y = _spans(
        grid.height, grid.south_west.north_m - prior.south_west.north_m, scale, prior.height, prior
    )
    weights = grid.weights.copy()
    on_x, on_y = (middle_x >= 0), (middle_y >= 0)
    known = prior.weights[np.ix_(middle_y[on_y], middle_x[on_x])]
    weights[np.ix_(on_y, on_x)] = np.where(known < OBSTACLE, known, weights[np.ix_(on_y, on_x)])
    # The number of obstacles in a rectangle of the map, from the four corners of their cumulative sum.
    total = np.zeros((prior.height + 1, prior.width + 1), dtype=np.int64)
    total[1:, 1:] = np.cumsum(np.cumsum(prior.weights >= OBSTACLE, axis=0, dtype=np.int64), axis=1)
    count = total[np.ix_(high_y, high_x)] - total[np.ix_(low_y, high_x)]
    count += total[np.ix_(low_y, low_x)] - total[np.ix_(high_y, low_x)]
    weights[count > 0] = OBSTACLE
    return grid.with_weights(weights)


def _spans(fields: int, offset_m: float, scale: float, size: int, prior: Grid) -> tuple[Indices, Indices, Indices]:
    """For the fields along one axis: the map's fields [low, high) that it overlaps, and the one at its middle or -1."""
    start = offset_m / prior.resolution_m + np.arange(fields) * scale
    edge = EDGE * min(scale, 1.0)
    low = np.clip(np.floor(start + edge), 0, size).astype(np.int64)
    high = np.clip(np.ceil(start + scale - edge), 0, size).astype(np.int64)
    middle = np.floor(start + scale / 2.0)
    inside = (middle >= 0) & (middle < size)
    return low, np.maximum(low, high), np.where(inside, middle, -1.0).astype(np.int64)
