"""World files: TOML with obstacles, doors, slippery and rough ground as shapes in metres, with or without a map.

Places are metres north and east of the world's south-west corner. Shapes are drawn into fields that are fine enough
for rays and contact; an obstacle takes every field whose centre it covers or comes within half a field of, so it is
never thinner than written.

Nouns: world file.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Grid
from companion.mapping.map_files import MapError, load_map
from companion.mission.mission import MoverSpec
from companion.mission.tables import FileName, Name, Positive, Table, named
from companion.mission.toml_reader import MoverTable
from companion.mission.world_shapes import ObstacleTable, ShapeTable
from companion.storage.toml_file import read_table
from sitl.world.doors import FOR_EVER_MS, Door, whole_ms
from sitl.world.movers import Announcement, Mover, timed_track
from sitl.world.world import FIRM, TOP_SPEED_M_S, Ground, World

FINE_M = 0.1
MAX_FIELDS = 10_000_000
MOSTLY = 0.4
"""A shape of which less lies in the world was hardly meant so: one on the edge has half of it there."""
Mask = NDArray[np.bool_]
Seconds = Annotated[float, Field(ge=0.0, le=1e6)]


class DoorTable(ObstacleTable):
    """``[[door]]``: an obstacle except while it is open."""

    name: Name | None = None
    open_s: Annotated[list[Annotated[list[Seconds], Field(min_length=1, max_length=2)]], Field(max_length=1000)]
    period_s: Positive | None = None

    def timetable_ms(self) -> tuple[tuple[int, int], ...]:
        """When it is open. Raises ValueError for spans that end before they begin or after the period, or overlap."""
        spans = tuple((whole_ms(s[0]), whole_ms(s[1]) if len(s) == 2 else FOR_EVER_MS) for s in self.open_s)
        for begin, end in spans:
            if end <= begin:
                raise ValueError(f"open_s: the span from {begin / 1000:g} s ends at {end / 1000:g} s")
            if self.period_s is not None and end > whole_ms(self.period_s):
                raise ValueError(f"open_s: the span from {begin / 1000:g} s goes beyond period_s")
        for (begin, end), (then, _) in pairwise(sorted(spans)):
            if then < end:
                raise ValueError(
                    f"open_s: the spans from {begin / 1000:g} s and from {then / 1000:g} s overlap; make one of them"
                )
        return spans


class SlipperyTable(ShapeTable):
    """``[[slippery]]``: ground with less grip; it falls from 1 at the edge to ``grip`` at ``edge_m`` inside."""

    grip: Annotated[float, Field(ge=0.01, le=1.0)]
    edge_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0


class RoughTable(ShapeTable):
    """``[[rough]]``: ground with a top speed."""

    top_speed_m_s: Annotated[float, Field(gt=0.0, le=TOP_SPEED_M_S)]


class WorldTable(Table):
    """The whole file."""

    base: FileName | None = None
    base_resolution_m: Positive | None = None
    size_m: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = None
    resolution_m: Annotated[float, Field(ge=0.01, le=10.0)] | None = None
    obstacle: list[ObstacleTable] = Field(default_factory=list)
    door: list[DoorTable] = Field(default_factory=list)
    slippery: list[SlipperyTable] = Field(default_factory=list)
    rough: list[RoughTable] = Field(default_factory=list)
    mover: Annotated[list[MoverTable], Field(max_length=100, default_factory=list)]


def load_world(path: Path, resolution_m: float | None = None) -> World:
    """Read a world: a map file as ``load_map`` reads it (its south-west corner becomes 0, 0), or a TOML world file.

    ``resolution_m`` is the field size of maps that have none of their own. Raises MapError: one line.
    """
    if path.suffix.lower() != ".toml":
        grid = load_map(path, resolution_m)
        return World.from_grid(Grid(grid.weights, grid.resolution_m))
    table = read_table(path, WorldTable, MapError, "docs/worlds.md describes the file")
    drawing = _Drawing(path, *_base(path, table))
    obstacles = drawing.obstacles
    glass, black = np.zeros_like(obstacles), np.zeros_like(obstacles)
    solid = obstacles.copy()
    layers = {"solid": solid, "glass": glass, "black": black}
    for i, item in enumerate(table.obstacle, 1):
        layers[item.material] |= drawing.covered("obstacle", i, item)
    standing = solid | glass | black
    doors = tuple(drawing.door(i, item, standing, layers) for i, item in enumerate(table.door, 1))
    black &= ~solid
    glass &= ~solid & ~black
    specs = [named(path, "mover", i, partial(item.mover, i), MapError) for i, item in enumerate(table.mover, 1)]
    return World(
        standing,
        drawing.resolution_m,
        movers=movers_of(specs, (0.0, 0.0)),
        doors=doors,
        ground=drawing.ground(table),
        glass=glass if glass.any() else None,
        black=black if black.any() else None,
    )


def ground_grid(path: Path, resolution_m: float | None = None) -> Grid:
    """A world as fields for ``X,Y`` options: a map's own, or for a TOML file fields of ``resolution_m`` (default 1 m).

    A field of a TOML world is an obstacle if its centre lies in one that is always there.
    """
    if path.suffix.lower() != ".toml":
        return load_map(path, resolution_m)
    world, size_m = load_world(path), resolution_m or 1.0
    height, width = (max(1, math.ceil(side_m / size_m - 1e-9)) for side_m in (world.height_m, world.width_m))
    rows, columns = (
        np.minimum(((np.arange(count) + 0.5) * size_m / world.resolution_m).astype(np.int64), most - 1)
        for count, most in zip((height, width), world.obstacles.shape, strict=True)
    )
    return Grid(np.where(world.obstacles[np.ix_(rows, columns)], OBSTACLE, BASE_WEIGHT), size_m)


def movers_of(specs: list[MoverSpec], origin_m: tuple[float, float]) -> tuple[Mover, ...]:
    """The movers in the world frame; places of their routes are relative to ``origin_m`` (north, east)."""
    movers = []
    for one in specs:
        places_m = [(origin_m[0] + place.north_m, origin_m[1] + place.east_m) for place in one.route]
        track = timed_track(places_m, one.speed_m_s, one.start_s, repeats=one.repeat)
        movers.append(
            Mover(one.name, one.radius_m, track, one.repeat, Announcement(one.announce) if one.announce else None)
        )
    return tuple(movers)


class _Drawing:
    """Fields into which shapes are drawn; ``obstacles`` are those of the map underneath."""

    def __init__(self, path: Path, obstacles: Mask, resolution_m: float) -> None:
        self.path = path
        self.obstacles = obstacles
        self.resolution_m = resolution_m
        height, width = obstacles.shape
        self.north_m = (np.arange(height) + 0.5) * resolution_m
        self.east_m = (np.arange(width) + 0.5) * resolution_m

    def covered(self, kind: str, number: int, item: ShapeTable, *, obstacle: bool = True) -> Mask:
        """The fields of a shape: for an obstacle all that it touches, for ground those whose centre it covers."""
        shape = self._shape(kind, number, item)
        if obstacle:
            shape = shape.buffer(0.5 * self.resolution_m - 1e-6, join_style="mitre")
        shapely.prepare(shape)
        west, south, east, north = shape.bounds
        rows = slice(*np.searchsorted(self.north_m, (south, north)))
        columns = slice(*np.searchsorted(self.east_m, (west, east)))
        mask = np.zeros_like(self.obstacles)
        mask[rows, columns] = shapely.contains_xy(shape, *np.meshgrid(self.east_m[columns], self.north_m[rows]))
        return mask

    def door(self, number: int, item: DoorTable, standing: Mask, layers: dict[str, Mask]) -> Door:
        """A door, in the fields without other obstacles; its material is added to ``layers``."""
        spans_ms = named(self.path, "door", number, item.timetable_ms, MapError)
        fields = self.covered("door", number, item) & ~standing
        if item.material != "solid":
            layers[item.material] |= fields
        period_ms = whole_ms(item.period_s) if item.period_s is not None else 0
        return Door(item.name or f"door {number}", fields, spans_ms, period_ms)

    def ground(self, table: WorldTable) -> Ground:
        """Grip, and the share of its speed that the rover keeps; where areas overlap, the lower value counts."""
        if not (table.slippery or table.rough):
            return FIRM.copy()
        ground = np.ones((2, *self.obstacles.shape), dtype=np.float32)
        for i, area in enumerate(table.slippery, 1):
            mask = self.covered("slippery", i, area, obstacle=False)
            rows, columns = np.nonzero(mask)
            points = shapely.points(self.east_m[columns], self.north_m[rows])
            depth_m = shapely.distance(self._shape("slippery", i, area).boundary, points)
            share = np.minimum(depth_m / area.edge_m, 1.0) if area.edge_m > 0.0 else 1.0
            ground[0, mask] = np.minimum(ground[0, mask], 1.0 - share * (1.0 - area.grip))
        for i, rough in enumerate(table.rough, 1):
            mask = self.covered("rough", i, rough, obstacle=False)
            ground[1, mask] = np.minimum(ground[1, mask], rough.top_speed_m_s / TOP_SPEED_M_S)
        return ground

    def _shape(self, kind: str, number: int, item: ShapeTable) -> BaseGeometry:
        shape = named(self.path, kind, number, item.shape, MapError)
        height, width = self.obstacles.shape
        size_m = (width * self.resolution_m, height * self.resolution_m)
        # size_m is east first, as pictures are, places are north first, as in missions.
        here, turned = (shapely.box(0.0, 0.0, *sides_m) for sides_m in (size_m, size_m[::-1]))
        says = remedy = ""
        if not shape.intersects(here):
            says, remedy = "lies outside", "move it inside"
            if shape.intersects(turned):
                remedy = "places are [north, east], are they the other way round?"
        elif shape.intersection(here).area < MOSTLY * shape.area and shape.within(turned):
            says, remedy = "lies mostly outside", "size_m is [east, north], places are [north, east]: is one turned?"
        if says:
            world = f"the world, {size_m[0]:g} m east and {size_m[1]:g} m north"
            raise MapError(f"{self.path}: {kind} {number}: {says} {world}; {remedy}")
        return shape


def _base(path: Path, table: WorldTable) -> tuple[Mask, float]:
    """The obstacles of the map underneath, in fields to draw on, and the size of a field."""
    if table.base is None:
        if table.size_m is None or table.base_resolution_m is not None:
            raise MapError(
                f"{path}: size_m: [east, north] is needed without a base, and no base_resolution_m; give it, or a base"
            )
        resolution_m = table.resolution_m or FINE_M
        width, height = (max(1, math.ceil(side_m / resolution_m - 1e-9)) for side_m in table.size_m)
        _check_size(path, width, height)
        return np.zeros((height, width), dtype=np.bool_), resolution_m
    if table.size_m is not None:
        raise MapError(f"{path}: size_m: the base, {table.base}, already has a size; leave size_m out")
    if Path(table.base).suffix.lower() == ".toml":
        raise MapError(f"{path}: base: {table.base} is a world file; it must be a map (image, ROS yaml, MovingAI .map)")
    try:
        grid = load_map(path.parent / table.base, table.base_resolution_m)
    except MapError as error:
        raise MapError(f"{path}: base: it cannot be used: {error}") from error
    resolution_m = table.resolution_m or grid.resolution_m / math.ceil(grid.resolution_m / FINE_M - 1e-9)
    times = round(grid.resolution_m / resolution_m)
    if times < 1 or abs(times * resolution_m - grid.resolution_m) > 1e-9:
        raise MapError(
            f"{path}: resolution_m: {resolution_m:g} m does not divide the base's fields of {grid.resolution_m:g} m; "
            "choose a whole part of that"
        )
    _check_size(path, grid.width * times, grid.height * times)
    return np.repeat(np.repeat(grid.weights >= OBSTACLE, times, axis=0), times, axis=1), grid.resolution_m / times


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MAX_FIELDS:
        raise MapError(
            f"{path}: resolution_m: {width} x {height} fields are more than {MAX_FIELDS}; choose larger ones"
        )
