"""Metres to evidence cells and back: the one conversion between the local frame and the raster of a map.

Nouns: cell frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint

Points = NDArray[np.float64]
"""Shape (n, 2). In metres: columns north and east. In cells: columns x (east) and y (north)."""


@dataclass(frozen=True, slots=True)
class CellFrame:
    """Where the cells of a raster lie: its south-west corner in the local frame, and the side of a cell in metres.

    In cells a place is (x, y), x east and y north of that corner; a curvature is per cell.
    """

    south_west: NedPoint
    cell_m: float

    def xy(self, point: NedPoint) -> tuple[float, float]:
        """A place in cells."""
        scale, corner = 1.0 / self.cell_m, self.south_west
        return (point.east_m - corner.east_m) * scale, (point.north_m - corner.north_m) * scale

    def xys(self, points: Points) -> Points:
        """Places in cells: shape (n, 2), columns x and y, from columns north and east in metres."""
        scale, corner = 1.0 / self.cell_m, self.south_west
        xys = np.empty(points.shape)
        xys[:, 0] = (points[:, 1] - corner.east_m) * scale
        xys[:, 1] = (points[:, 0] - corner.north_m) * scale
        return xys

    def point(self, x: float, y: float) -> NedPoint:
        """A place in metres."""
        return NedPoint(self.south_west.north_m + y * self.cell_m, self.south_west.east_m + x * self.cell_m)

    def points(self, xys: Points) -> Points:
        """Places in metres: shape (n, 2), columns north and east, from columns x and y in cells."""
        metres = xys * self.cell_m
        return np.column_stack((metres[:, 1] + self.south_west.north_m, metres[:, 0] + self.south_west.east_m))

    def cells(self, length_m: float) -> float:
        """A length in cells."""
        return length_m * (1.0 / self.cell_m)

    def metres(self, length: float) -> float:
        """A length in metres."""
        return length / (1.0 / self.cell_m)

    def per_cell(self, curvature_per_m: float) -> float:
        """A curvature per cell."""
        return curvature_per_m / (1.0 / self.cell_m)

    def per_m(self, curvature: float) -> float:
        """A curvature in 1/m."""
        return curvature * (1.0 / self.cell_m)
