"""The simulated world: obstacles, lengths of rays, free room around a place, and what the ground is like.

The world frame is metres north and east; obstacles are the fields of a boolean array indexed ``[y, x]`` (y grows
north, x grows east) whose outer south-west corner may lie anywhere. Ground outside the array is open and firm.

Nouns: World.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Grid
from sitl.world.doors import Door, next_change_s
from sitl.world.movers import Fleet, Mover, fleet_of, motion_of, shorten_rays

Obstacles = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ground = NDArray[np.float32]
"""Shape (2, height, width): grip and the share of its speed that the rover keeps on a field, both 0 to 1; size 0: 1
everywhere."""

TOP_SPEED_M_S = 4.0
"""The rover's top speed on firm ground; rough fields allow a share of it."""

FIRM: Ground = np.ones((2, 0, 0), dtype=np.float32)
"""Ordinary ground everywhere."""


class FieldGrid(NamedTuple):
    """Fields of the world, ``fields[y, x]``, with their outer south-west corner and the side of a field."""

    fields: Obstacles
    south_m: float
    west_m: float
    resolution_m: float


class Layers(NamedTuple):
    """The obstacles at a moment: those that the rover touches, that reflect rays, that absorb rays (None: none)."""

    solid: FieldGrid
    echoing: FieldGrid
    dark: FieldGrid | None


class Surroundings(NamedTuple):
    """What the rover drives on and may touch, for compiled code."""

    solid: FieldGrid
    ground: Ground
    fleet: Fleet


@njit(cache=True, nogil=True)
def in_fields(grid: FieldGrid, north_m: float, east_m: float) -> tuple[float, float]:
    """A place counted in fields from the south-west corner: x east, y north."""
    return (east_m - grid.west_m) / grid.resolution_m, (north_m - grid.south_m) / grid.resolution_m


@njit(cache=True, nogil=True)
def ray_length(grid: FieldGrid, north_m: float, east_m: float, bearing_rad: float, max_m: float) -> float:
    """Metres from a place to the first obstacle along a bearing, or ``max_m`` when there is none nearer.

    Visits every field that the ray touches (Amanatides & Woo's traversal), so that it cannot skip a thin wall.
    A place inside an obstacle gives 0.
    """
    height, width = grid.fields.shape
    x, y = in_fields(grid, north_m, east_m)
    dx = math.sin(bearing_rad)
    dy = math.cos(bearing_rad)
    column = math.floor(x)
    row = math.floor(y)
    step_x = 1 if dx > 0.0 else -1
    step_y = 1 if dy > 0.0 else -1
    cross_x = 1.0 / abs(dx) if abs(dx) > 1e-12 else math.inf
    cross_y = 1.0 / abs(dy) if abs(dy) > 1e-12 else math.inf
    next_x = math.inf
    if cross_x < math.inf:
        next_x = ((column + 1 - x) if dx > 0.0 else (x - column)) * cross_x
    next_y = math.inf
    if cross_y < math.inf:
        next_y = ((row + 1 - y) if dy > 0.0 else (y - row)) * cross_y
    reach = max_m / grid.resolution_m
    travelled = 0.0
    while travelled < reach:
        if 0 <= column < width and 0 <= row < height and grid.fields[row, column]:
            return travelled * grid.resolution_m
        if next_x < next_y:
            travelled = next_x
            next_x += cross_x
            column += step_x
        else:
            travelled = next_y
            next_y += cross_y
            row += step_y
    return max_m


@njit(cache=True, nogil=True)
def ray_lengths(
    grid: FieldGrid, north_m: float, east_m: float, bearings_rad: Floats, max_m: float, lengths_m: Floats
) -> None:
    """Fill ``lengths_m`` with the shortest of the rays of each row of ``bearings_rad`` (shape: sectors x rays)."""
    for sector in range(bearings_rad.shape[0]):
        shortest_m = max_m
        for ray in range(bearings_rad.shape[1]):
            length_m = ray_length(grid, north_m, east_m, bearings_rad[sector, ray], shortest_m)
            shortest_m = min(shortest_m, length_m)
        lengths_m[sector] = shortest_m


@njit(cache=True, nogil=True)
def ground_under(ground: Ground, grid: FieldGrid, north_m: float, east_m: float) -> tuple[float, float]:
    """Grip, and the share of its speed that the rover keeps, at a place; ``grid`` locates the ground's fields."""
    if ground.size == 0:
        return 1.0, 1.0
    x, y = in_fields(grid, north_m, east_m)
    column, row = math.floor(x), math.floor(y)
    if row < 0 or column < 0 or row >= ground.shape[1] or column >= ground.shape[2]:
        return 1.0, 1.0
    return float(ground[0, row, column]), float(ground[1, row, column])


@njit(cache=True, nogil=True)
def clearance_m(grid: FieldGrid, north_m: float, east_m: float, reach_m: float) -> float:
    """Metres from a place to the nearest obstacle field's square, or ``reach_m`` when none is that near."""
    height, width = grid.fields.shape
    x, y = in_fields(grid, north_m, east_m)
    reach = reach_m / grid.resolution_m
    nearest = reach * reach
    for row in range(max(0, math.floor(y - reach)), min(height - 1, math.floor(y + reach)) + 1):
        for column in range(max(0, math.floor(x - reach)), min(width - 1, math.floor(x + reach)) + 1):
            if grid.fields[row, column]:
                gap_x = max(column - x, 0.0, x - (column + 1))
                gap_y = max(row - y, 0.0, y - (row + 1))
                nearest = min(nearest, gap_x * gap_x + gap_y * gap_y)
    return math.sqrt(nearest) * grid.resolution_m


@dataclass(frozen=True, eq=False)
class World:
    """Obstacles, ``obstacles[y, x]``, with the south-west corner of field (0, 0); doors, movers, ground.

    ``glass``: obstacle fields that rays pass through; ``black``: those that absorb them. ``doors`` have fields of
    their own, in addition to ``obstacles``; these may be glass or black too. All arrays have the same shape.
    """

    obstacles: Obstacles
    resolution_m: float = 1.0
    south_m: float = 0.0
    west_m: float = 0.0
    movers: tuple[Mover, ...] = ()
    doors: tuple[Door, ...] = ()
    ground: Ground = field(default_factory=FIRM.copy)
    glass: Obstacles | None = None
    black: Obstacles | None = None
    fleet: Fleet = field(init=False)
    _layers: dict[tuple[bool, ...], Layers] = field(init=False, default_factory=dict)
    _without_doors: Layers = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "fleet", fleet_of(self.movers))
        object.__setattr__(self, "_without_doors", self._made((True,) * len(self.doors)))

    @classmethod
    def open(cls, width_m: float = 1.0, height_m: float = 1.0) -> World:
        """Ground without any obstacle."""
        return cls(np.zeros((max(1, math.ceil(height_m)), max(1, math.ceil(width_m))), dtype=np.bool_))

    @classmethod
    def from_grid(cls, grid: Grid) -> World:
        """The obstacle fields of a grid, in the same place; weights below an obstacle's are open ground."""
        obstacles = np.ascontiguousarray(grid.weights >= OBSTACLE)
        return cls(obstacles, grid.resolution_m, grid.south_west.north_m, grid.south_west.east_m)

    @property
    def width_m(self) -> float:
        """Metres from the west edge of the array to the east edge."""
        return int(self.obstacles.shape[1]) * self.resolution_m

    @property
    def height_m(self) -> float:
        """Metres from the south edge of the array to the north edge."""
        return int(self.obstacles.shape[0]) * self.resolution_m

    def layers(self, time_s: float = 0.0) -> Layers:
        """The obstacles at a moment; the arrays are kept, one set for each state of the doors."""
        if not self.doors:
            return self._without_doors
        state = tuple(door.is_open(time_s) for door in self.doors)
        if state not in self._layers:
            self._layers[state] = self._made(state)
        return self._layers[state]

    def _made(self, opened: tuple[bool, ...]) -> Layers:
        solid = self.obstacles
        for door, is_open in zip(self.doors, opened, strict=True):
            solid = solid if is_open else solid | door.fields
        echoing = solid if self.glass is None else solid & ~self.glass
        dark = None if self.black is None else echoing & self.black
        echoing = echoing if dark is None else echoing & ~dark
        return Layers(self._grid(solid), self._grid(echoing), None if dark is None else self._grid(dark))

    def _grid(self, fields: Obstacles) -> FieldGrid:
        return FieldGrid(fields, self.south_m, self.west_m, self.resolution_m)

    def surroundings(self, time_s: float) -> Surroundings:
        """What the rover may touch at a moment (it stays so until ``next_change_s``), and the ground."""
        return Surroundings(self.layers(time_s).solid, self.ground, self.fleet)

    def next_change_s(self, time_s: float) -> float:
        """When a door next opens or closes, after a moment; infinity if none ever does."""
        return next_change_s(self.doors, time_s)

    def rays_m(self, north_m: float, east_m: float, bearings_rad: Floats, max_m: float, time_s: float = 0.0) -> Floats:
        """The shortest ray of each row of bearings (sectors x rays) at a moment, ``max_m`` where nothing was hit."""
        layers = self.layers(time_s)
        if layers.dark is not None:
            return self._rays_in_the_dark_m(layers, north_m, east_m, bearings_rad, max_m, time_s)
        lengths_m = np.empty(bearings_rad.shape[0])
        ray_lengths(layers.echoing, north_m, east_m, bearings_rad, max_m, lengths_m)
        self._meet_movers(north_m, east_m, bearings_rad, time_s, lengths_m)
        return lengths_m

    def _rays_in_the_dark_m(
        self, layers: Layers, north_m: float, east_m: float, bearings_rad: Floats, max_m: float, time_s: float
    ) -> Floats:
        """Ray by ray, because one that is absorbed must not see what moves behind that place."""
        assert layers.dark is not None
        each_rad = np.ascontiguousarray(bearings_rad.reshape(-1, 1))
        lengths_m, absorbed_m = np.empty(len(each_rad)), np.empty(len(each_rad))
        ray_lengths(layers.echoing, north_m, east_m, each_rad, max_m, lengths_m)
        ray_lengths(layers.dark, north_m, east_m, each_rad, max_m, absorbed_m)
        self._meet_movers(north_m, east_m, each_rad, time_s, lengths_m)
        lengths_m[absorbed_m < lengths_m] = max_m
        nearest_m: Floats = lengths_m.reshape(bearings_rad.shape).min(axis=1)
        return nearest_m

    def _meet_movers(
        self, north_m: float, east_m: float, bearings_rad: Floats, time_s: float, lengths_m: Floats
    ) -> None:
        if self.movers:
            shorten_rays(self.fleet, time_s, north_m, east_m, bearings_rad, lengths_m)

    def mover_at(self, number: int, time_s: float) -> tuple[float, float, float, float]:
        """Where a mover is at a moment, north and east, and its velocity."""
        return motion_of(self.fleet, number, time_s)

    def clearance_m(self, north_m: float, east_m: float, reach_m: float, time_s: float = 0.0) -> float:
        """Metres from a place to the nearest obstacle that stands at a moment, at most ``reach_m``."""
        return float(clearance_m(self.layers(time_s).solid, north_m, east_m, reach_m))

    def nearest_door(self, north_m: float, east_m: float, reach_m: float, time_s: float) -> str | None:
        """The name of the closed door that is the nearest obstacle to a place; None if there is none, or not so near.

        A place in a door that has just closed counts, too.
        """
        nearest_m = self.clearance_m(north_m, east_m, reach_m, time_s)
        for door in self.doors:
            if not door.is_open(time_s) and nearest_m < reach_m:
                door_m = float(clearance_m(self._grid(door.fields), north_m, east_m, reach_m))
                if door_m <= nearest_m + 1e-9:
                    return door.name
        return None
