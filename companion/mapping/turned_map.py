"""Turned maps: a map whose fields lie askew (the yaw of a ROS map's origin) on a grid that looks north.

Nouns: turned map.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Grid, Weights

EDGE = 1e-6
"""Fields that overlap by less than this share of their side count as neighbours: rounding errors."""
BLOCK_FIELDS = 1_000_000
"""So many fields are looked up at a time: memory."""


def turned_size(width: int, height: int, yaw_rad: float) -> tuple[int, int]:
    """Width and height, in fields, of the grid round a turned map of ``width`` x ``height`` fields."""
    low, high = _extent(width, height, yaw_rad)
    across, up = np.ceil(high - low - EDGE)
    return max(int(across), 1), max(int(up), 1)


def turned(weights: Weights, resolution_m: float, corner: NedPoint, yaw_rad: float) -> Grid:
    """The map on a grid with fields of the same size, its south-west corner that of the smallest such grid round it.

    ``weights``: shape (height, width), as in ``Grid``; ``corner``: the outer corner of field (0, 0), about which the
    map is turned by ``yaw_rad``, counterclockwise. The rule: a field of the new grid is an obstacle if any obstacle of
    the map overlaps it, so none is lost or becomes smaller; otherwise it gets the weight of the map's field at its
    middle. Outside the map it has the base weight.
    """
    height, width = weights.shape
    low, _ = _extent(width, height, yaw_rad)
    across, up = turned_size(width, height, yaw_rad)
    new = np.full((up, across), BASE_WEIGHT)
    _look_up(new, weights, low, yaw_rad)
    _stamp_obstacles(new, weights, low, yaw_rad)
    east_m, north_m = (float(value) * resolution_m for value in low)
    return Grid(new, resolution_m, NedPoint(corner.north_m + north_m, corner.east_m + east_m))


def _extent(width: int, height: int, yaw_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest x, y of the turned map's corners, in fields from its own corner."""
    corners = np.array([(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)])
    places = corners @ _axes(yaw_rad)
    return places.min(axis=0), places.max(axis=0)


def _axes(yaw_rad: float) -> NDArray[np.float64]:
    """The map's axes as rows: x, y of the grid for one field along each."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([(cos, sin), (-sin, cos)])


def _look_up(new: Weights, weights: Weights, low: NDArray[np.float64], yaw_rad: float) -> None:
    """For each field the weight of what is no obstacle at its middle."""
    height, width = weights.shape
    axes, across = _axes(yaw_rad), new.shape[1]
    xs = np.arange(across) + 0.5 + low[0]
    rows = max(BLOCK_FIELDS // across, 1)
    for first in range(0, new.shape[0], rows):
        ys = np.arange(first, min(first + rows, new.shape[0]))[:, None] + 0.5 + low[1]
        there_x = np.floor(xs * axes[0, 0] + ys * axes[0, 1]).astype(np.int64)
        there_y = np.floor(xs * axes[1, 0] + ys * axes[1, 1]).astype(np.int64)
        inside = (there_x >= 0) & (there_x < width) & (there_y >= 0) & (there_y < height)
        found = weights[np.clip(there_y, 0, height - 1), np.clip(there_x, 0, width - 1)]
        block = new[first : first + len(ys)]
        np.copyto(block, found, where=inside & (found < OBSTACLE))


def _stamp_obstacles(new: Weights, weights: Weights, low: NDArray[np.float64], yaw_rad: float) -> None:
    """Every field that a turned obstacle overlaps: two squares are apart if they are along a side of one of them."""
    axes = _axes(yaw_rad)
    obstacle_y, obstacle_x = np.nonzero(weights >= OBSTACLE)
    reach = 0.5 + 0.5 * float(np.abs(axes[0]).sum()) - EDGE
    for first in range(0, len(obstacle_x), BLOCK_FIELDS):
        block = slice(first, first + BLOCK_FIELDS)
        centres = np.column_stack((obstacle_x[block] + 0.5, obstacle_y[block] + 0.5)) @ axes - low
        cells = np.floor(centres).astype(np.int64)
        for step in np.ndindex(3, 3):
            near = cells + np.array(step) - 1
            apart = near + 0.5 - centres
            along = apart @ axes.T
            hit = (np.abs(apart) < reach).all(axis=1) & (np.abs(along) < reach).all(axis=1)
            hit &= (near >= 0).all(axis=1) & (near[:, 0] < new.shape[1]) & (near[:, 1] < new.shape[0])
            new[near[hit, 1], near[hit, 0]] = OBSTACLE
