"""The map: a rectangle of square fields with a weight each.

Weights are the paper's (Kwasniewski & Gosiewski 2018, section 2): 1 is an obstacle, 0.5 the base value, 0 preferred
ground, anything between is the cost of passing. Field (0, 0) lies in the south-west corner, x grows east,
y grows north; arrays are indexed ``[y, x]``.

Nouns: grid, field, weight.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint

OBSTACLE = 1.0
BASE_WEIGHT = 0.5

Weights = NDArray[np.float64]


class Cell(NamedTuple):
    """A field's place in its grid: x grows east, y grows north."""

    x: int
    y: int


def as_array(cells: Iterable[Cell]) -> NDArray[np.int64]:
    """Fields as an array of shape (n, 2), columns x and y."""
    return np.array([(cell.x, cell.y) for cell in cells], np.int64).reshape(-1, 2)


def as_cells(cells: NDArray[np.int64]) -> tuple[Cell, ...]:
    """Fields from an array of shape (n, 2), columns x and y."""
    # ``Cell(x, y)`` for each row takes three times as long; this makes the same objects.
    return tuple(map(tuple.__new__, repeat(Cell), zip(*cells.T.tolist(), strict=True)))


@dataclass(frozen=True, eq=False)
class Grid:
    """Field weights, and where the fields lie in the local frame.

    ``weights`` has shape ``(height, width)``, values 0..1. ``south_west`` is the outer corner of field (0, 0).
    """

    weights: Weights
    resolution_m: float = 1.0
    south_west: NedPoint = NedPoint(0.0, 0.0)  # noqa: RUF009 - frozen, so one shared default is safe

    @property
    def width(self) -> int:
        """Fields from west to east."""
        return int(self.weights.shape[1])

    @property
    def height(self) -> int:
        """Fields from south to north."""
        return int(self.weights.shape[0])

    def cell_at(self, point: NedPoint) -> Cell:
        """The field that a place lies in; may be outside the grid (see ``contains``)."""
        return Cell(
            math.floor((point.east_m - self.south_west.east_m) / self.resolution_m),
            math.floor((point.north_m - self.south_west.north_m) / self.resolution_m),
        )

    def centre_of(self, cell: Cell) -> NedPoint:
        """The middle of a field."""
        return NedPoint(
            self.south_west.north_m + (cell.y + 0.5) * self.resolution_m,
            self.south_west.east_m + (cell.x + 0.5) * self.resolution_m,
        )

    def places_of(self, fields: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places given in fields as places in metres: shape (n, 2), from columns x, y to columns north, east.

        In fields a whole number is the middle of a field.
        """
        north_m = self.south_west.north_m + (fields[:, 1] + 0.5) * self.resolution_m
        east_m = self.south_west.east_m + (fields[:, 0] + 0.5) * self.resolution_m
        return np.column_stack((north_m, east_m))

    def in_fields(self, point: NedPoint) -> tuple[float, float]:
        """A place in metres as x, y in fields, where a whole number is the middle of a field."""
        x = (point.east_m - self.south_west.east_m) / self.resolution_m - 0.5
        y = (point.north_m - self.south_west.north_m) / self.resolution_m - 0.5
        return x, y

    def fields(self, length_m: float) -> float:
        """A length in fields."""
        return length_m / self.resolution_m

    def contains(self, cell: Cell) -> bool:
        """Whether the field is part of this grid."""
        return 0 <= cell.x < self.width and 0 <= cell.y < self.height

    def is_obstacle(self, cell: Cell) -> bool:
        """Whether the rover may not enter the field; ground outside the grid counts as an obstacle."""
        return not self.contains(cell) or bool(self.weights[cell.y, cell.x] >= OBSTACLE)

    def with_weights(self, weights: Weights) -> Grid:
        """The same fields with other weights."""
        return Grid(weights, self.resolution_m, self.south_west)


def empty_grid(
    width: int,
    height: int,
    resolution_m: float = 1.0,
    south_west: NedPoint = NedPoint(0.0, 0.0),  # noqa: B008 - frozen
) -> Grid:
    """A grid of base weight. Raises ValueError unless it has at least one field of positive size."""
    if width < 1 or height < 1 or not resolution_m > 0.0:
        raise ValueError(
            f"a grid needs at least 1 x 1 fields of positive size, not {width} x {height} of {resolution_m} m"
        )
    return Grid(np.full((height, width), BASE_WEIGHT), resolution_m, south_west)


def inflated(weights: Weights, radius_fields: float) -> Weights:
    """A copy with every field an obstacle whose centre is nearer to an obstacle field's square than the radius.

    ``radius_fields`` is the rover's radius (and margin) in fields. Half a field or less changes nothing: such a
    rover fits into a field beside an obstacle (the paper's section 2).
    """
    reach = math.ceil(radius_fields + 0.5)
    result = weights.copy()
    blocked = weights >= OBSTACLE
    height, width = weights.shape
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            gap = math.hypot(max(abs(dx) - 0.5, 0.0), max(abs(dy) - 0.5, 0.0))
            if (dx == 0 and dy == 0) or gap >= radius_fields:
                continue
            here = (slice(max(0, dy), height + min(0, dy)), slice(max(0, dx), width + min(0, dx)))
            there = (slice(max(0, -dy), height + min(0, -dy)), slice(max(0, -dx), width + min(0, -dx)))
            result[here][blocked[there]] = OBSTACLE
    return result
