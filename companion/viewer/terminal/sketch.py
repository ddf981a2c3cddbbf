"""Ground as square dots for a terminal, north up: what each dot shows, and which part of the ground is shown.

Metres north and east of any one place: the local frame's origin, or a simulated world's.

Nouns: sketch, viewport.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum, auto
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

COARSEST_M = 2.5
"""Largest side of a dot; of larger ground only the part around the rover is shown."""
FOLLOWING_M = 1.0
"""Side of a dot when only a part of the ground is shown."""
STEP_M = 10.0
"""Open ground is shown in multiples of this, so that the scale does not change all the time."""
MARGIN_M = 3.0


class Kind(IntEnum):
    """What a dot shows; of several things in one dot the last in this list counts."""

    NOTHING = 0
    SEEN = 1
    ROUGH = 2
    SLIPPERY = 3
    OPEN_DOOR = 4
    TRACK = 5
    PATH = 6
    HIDDEN = 7
    CLOSED = 8
    WALL = 9
    BLACK = 10
    GLASS = 11
    DOOR = 12
    MOVER = 13


Dots = NDArray[np.uint8]
"""Kinds, shape (rows, columns), row 0 in the north."""


class Layer(NamedTuple):
    """Fields of one kind: ``where[y, x]``, the side of a field, and the outer south-west corner."""

    kind: Kind
    where: NDArray[np.bool_]
    resolution_m: float
    south_m: float
    west_m: float


class Disc(NamedTuple):
    """A disc: centre and radius."""

    north_m: float
    east_m: float
    radius_m: float


class PlaceState(Enum):
    """What a place is, or what has become of a target."""

    PENDING = auto()
    REACHED = auto()
    LOST = auto()
    START = auto()


@dataclass(frozen=True, slots=True)
class Place:
    """A place with a name: the start or a target."""

    name: str
    north_m: float
    east_m: float
    state: PlaceState = PlaceState.PENDING


@dataclass(frozen=True, eq=False, slots=True)
class Sketch:
    """Everything to draw. ``bounds_m``: south, west, north, east.

    ``rover``: None before its place is known. ``track``: where it was, ``path``: where it is to go, shape (n, 2), north
    and east.
    """

    layers: tuple[Layer, ...]
    rover: Disc | None
    heading_rad: float
    track: NDArray[np.float64]
    path: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    movers: tuple[Disc, ...] = ()
    places: tuple[Place, ...] = ()
    bounds_m: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Viewport:
    """The part of the ground that is shown: north-west corner, side of a dot, number of dots."""

    north_m: float
    west_m: float
    dot_m: float
    rows: int
    columns: int

    def dot(self, north_m: float, east_m: float) -> tuple[int, int] | None:
        """Row and column of a place; None outside."""
        row = math.floor((self.north_m - north_m) / self.dot_m)
        column = math.floor((east_m - self.west_m) / self.dot_m)
        return (row, column) if 0 <= row < self.rows and 0 <= column < self.columns else None


def viewport_for(sketch: Sketch, rows: int, columns: int) -> Viewport:
    """The whole sketch if dots of ``COARSEST_M`` are enough for it; otherwise the part around the rover."""
    south_m, west_m, north_m, east_m = sketch.bounds_m or _extent_m(sketch)
    dot_m = max((north_m - south_m) / rows, (east_m - west_m) / columns)
    if dot_m <= COARSEST_M or sketch.rover is None:
        spare_n, spare_e = rows * dot_m - (north_m - south_m), columns * dot_m - (east_m - west_m)
        return Viewport(north_m + spare_n / 2.0, west_m - spare_e / 2.0, dot_m, rows, columns)
    dot_m = FOLLOWING_M
    middle_n = _kept_inside(sketch.rover.north_m, south_m, north_m, rows * dot_m)
    middle_e = _kept_inside(sketch.rover.east_m, west_m, east_m, columns * dot_m)
    # Whole dots, so that walls do not shimmer while the rover moves.
    top_m = (math.floor(middle_n / dot_m) + 1 + (rows - 1) // 2) * dot_m
    return Viewport(top_m, (math.floor(middle_e / dot_m) - columns // 2) * dot_m, dot_m, rows, columns)


def _kept_inside(middle_m: float, low_m: float, high_m: float, shown_m: float) -> float:
    """The middle of the part shown: near the rover, but not beyond the ground's edges."""
    if high_m - low_m <= shown_m:
        return 0.5 * (low_m + high_m)
    return min(max(middle_m, low_m + shown_m / 2.0), high_m - shown_m / 2.0)


def _extent_m(sketch: Sketch) -> tuple[float, float, float, float]:
    """South, west, north and east of everything in the sketch, with a margin, in multiples of ``STEP_M``."""
    discs = (*sketch.movers, *(() if sketch.rover is None else (sketch.rover,)))
    spots = [(one.north_m, one.east_m) for one in (*discs, *sketch.places)] or [(0.0, 0.0)]
    points = np.concatenate([np.array(spots), sketch.track, sketch.path])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    south_m, west_m = np.floor(low / STEP_M) * STEP_M
    north_m, east_m = np.ceil(high / STEP_M) * STEP_M
    return float(south_m), float(west_m), float(north_m), float(east_m)


def paint(sketch: Sketch, viewport: Viewport) -> Dots:
    """The kind of every dot."""
    dots: Dots = np.zeros((viewport.rows, viewport.columns), dtype=np.uint8)
    for layer in sketch.layers:
        here = _covered(layer, viewport)
        dots[here] = np.maximum(dots[here], layer.kind)
    _paint_line(sketch.track, Kind.TRACK, viewport, dots)
    _paint_line(sketch.path, Kind.PATH, viewport, dots)
    for mover in sketch.movers:
        _paint_disc(mover, viewport, dots)
    return dots


def _covered(layer: Layer, viewport: Viewport) -> NDArray[np.bool_]:
    """The dots that contain a field of the layer; if dots are smaller than fields, those whose centre lies in one."""
    south_m = viewport.north_m - viewport.rows * viewport.dot_m
    rows = _runs(south_m - layer.south_m, viewport.dot_m, viewport.rows, layer.resolution_m, layer.where.shape[0])
    columns = _runs(
        viewport.west_m - layer.west_m, viewport.dot_m, viewport.columns, layer.resolution_m, layer.where.shape[1]
    )
    covered = np.zeros((viewport.rows, viewport.columns), dtype=np.bool_)
    if rows is None or columns is None:
        return covered
    some_rows = np.logical_or.reduceat(layer.where[: rows.end], rows.begins, axis=0)
    some = np.logical_or.reduceat(some_rows[:, : columns.end], columns.begins, axis=1)
    covered[np.ix_(rows.dots, columns.dots)] = some
    return covered[::-1]


class _Runs(NamedTuple):
    """Along one axis: the dots that have fields, the first field of each, and the end of the last dot's fields."""

    dots: NDArray[np.intp]
    begins: NDArray[np.intp]
    end: int


def _runs(offset_m: float, dot_m: float, dots: int, field_m: float, fields: int) -> _Runs | None:
    """The fields of each dot; ``offset_m``: start of the first dot, relative to the first field."""
    if dot_m < field_m:
        begins = np.floor((offset_m + (np.arange(dots) + 0.5) * dot_m) / field_m).astype(np.intp)
        inside = np.flatnonzero((begins >= 0) & (begins < fields))
        # Several dots share a field: ``reduceat`` then takes only the first field of each.
        return _Runs(inside, begins[inside], int(begins[inside][-1]) + 1) if inside.size else None
    edges = np.ceil((offset_m + np.arange(dots + 1) * dot_m) / field_m - 0.5).astype(np.intp).clip(0, fields)
    inside = np.flatnonzero(edges[1:] > edges[:-1])
    return _Runs(inside, edges[inside], int(edges[inside[-1] + 1])) if inside.size else None


def _paint_line(line: NDArray[np.float64], kind: Kind, viewport: Viewport, dots: Dots) -> None:
    """Draw a line through the points, without gaps."""
    if len(line) == 0:
        return
    steps = np.abs(np.diff(line, axis=0)).max(axis=1, initial=0.0) / viewport.dot_m
    along = np.concatenate(([0.0], np.cumsum(np.maximum(steps, 1e-9))))
    fine = np.linspace(0.0, along[-1], max(len(line), math.ceil(2.0 * along[-1])))
    rows = np.floor((viewport.north_m - np.interp(fine, along, line[:, 0])) / viewport.dot_m).astype(np.intp)
    columns = np.floor((np.interp(fine, along, line[:, 1]) - viewport.west_m) / viewport.dot_m).astype(np.intp)
    inside = (rows >= 0) & (rows < viewport.rows) & (columns >= 0) & (columns < viewport.columns)
    here = (rows[inside], columns[inside])
    dots[here] = np.maximum(dots[here], kind)


def _paint_disc(disc: Disc, viewport: Viewport, dots: Dots) -> None:
    north_m = viewport.north_m - (np.arange(viewport.rows) + 0.5) * viewport.dot_m - disc.north_m
    east_m = viewport.west_m + (np.arange(viewport.columns) + 0.5) * viewport.dot_m - disc.east_m
    dots[np.hypot(north_m[:, None], east_m[None, :]) <= disc.radius_m] = Kind.MOVER
    middle = viewport.dot(disc.north_m, disc.east_m)
    if middle is not None:
        dots[middle] = Kind.MOVER


WORDS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


def compass_word(heading_rad: float) -> str:
    """The nearest of the eight compass points."""
    return WORDS[round(heading_rad / (math.pi / 4.0)) % 8]
