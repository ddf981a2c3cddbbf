"""Areas as shapes in the local frame, and which fields of a grid they touch or cover (rasterisation)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import Cell, Grid
from companion.mission.mission import Area, Here, Place

Mask = NDArray[np.bool_]

EDGE = 1e-6
"""A shape that overlaps a field by less than this share of its side does not touch it: rounding errors."""

CIRCLE_QUARTER = 32
"""Segments of a quarter circle; the polygon is at most 0.03 % narrower than the circle."""


@dataclass(frozen=True, slots=True)
class Places:
    """Converts a mission's places to the local frame.

    ``middle_of``: the middle of a field, if the mission's grid is fixed. Where a place is the rover's own, it is told
    to be at home: nobody drives there.
    """

    frame: LocalFrame
    home: NedPoint
    middle_of: Callable[[Cell], NedPoint]

    def point(self, place: Place) -> NedPoint:
        """The place in the local frame."""
        if isinstance(place, GeoPoint):
            return self.frame.to_ned(place)
        if isinstance(place, Cell):
            return self.middle_of(place)
        if isinstance(place, Here):
            return self.home
        return NedPoint(self.home.north_m + place.north_m, self.home.east_m + place.east_m)


def shape_of(area: Area, places: Places) -> BaseGeometry:
    """The area as a shape with x = metres east and y = metres north."""
    points = [places.point(place) for place in area.places]
    corners = [(point.east_m, point.north_m) for point in points]
    if area.radius_m is not None:
        return shapely.Point(corners[0]).buffer(area.radius_m, quad_segs=CIRCLE_QUARTER)
    if area.width_m is not None:
        return shapely.LineString(corners).buffer(area.width_m / 2.0, quad_segs=CIRCLE_QUARTER)
    return shapely.Polygon(corners)


def touched(grid: Grid, shape: BaseGeometry) -> Mask:
    """Which fields overlap the shape; shape (height, width)."""
    return _fields(grid, shape, whole=False)


def covered(grid: Grid, shape: BaseGeometry) -> Mask:
    """Which fields lie entirely inside the shape; shape (height, width)."""
    return _fields(grid, shape, whole=True)


def middles_in(grid: Grid, shape: BaseGeometry) -> Mask:
    """Which fields have their middle inside the shape or on its edge; shape (height, width)."""
    east_m = grid.south_west.east_m + (np.arange(grid.width) + 0.5) * grid.resolution_m
    north_m = grid.south_west.north_m + (np.arange(grid.height) + 0.5) * grid.resolution_m
    reach = shape.buffer(EDGE * grid.resolution_m)
    shapely.prepare(reach)
    return np.asarray(shapely.contains_xy(reach, east_m[None, :], north_m[:, None]), dtype=np.bool_)


def _fields(grid: Grid, shape: BaseGeometry, *, whole: bool) -> Mask:
    """Halves the grid until each block is entirely inside or outside the shape, or is a single field."""
    mask = np.zeros((grid.height, grid.width), dtype=np.bool_)
    shapely.prepare(shape)
    size_m = grid.resolution_m
    blocks = [(0, 0, grid.width, grid.height)]
    while blocks:
        x0, y0, x1, y1 = blocks.pop()
        square = shapely.box(
            grid.south_west.east_m + (x0 + EDGE) * size_m,
            grid.south_west.north_m + (y0 + EDGE) * size_m,
            grid.south_west.east_m + (x1 - EDGE) * size_m,
            grid.south_west.north_m + (y1 - EDGE) * size_m,
        )
        if not shape.intersects(square):
            continue
        if shape.covers(square):
            mask[y0:y1, x0:x1] = True
        elif x1 - x0 == 1 and y1 - y0 == 1:
            mask[y0, x0] = not whole
        else:
            blocks.extend(_halves(x0, y0, x1, y1))
    return mask


def _halves(x0: int, y0: int, x1: int, y1: int) -> list[tuple[int, int, int, int]]:
    if x1 - x0 >= y1 - y0:
        middle = (x0 + x1) // 2
        return [(x0, y0, middle, y1), (middle, y0, x1, y1)]
    middle = (y0 + y1) // 2
    return [(x0, y0, x1, middle), (x0, middle, x1, y1)]
