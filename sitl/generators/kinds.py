"""Kinds of ground: each has its parameters, and draws obstacles from random numbers with them.

One's own are named ``module:name`` or by an entry point of ``rover_companion.worlds``.

Nouns: ground kind.
"""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from enum import StrEnum
from itertools import pairwise
from typing import Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from companion.core.own_parts import OwnKind, OwnPartError, looks_own, own_part
from sitl.generators.canvas import EAST_M, FINE_M, NORTH_M, area, disc, empty, fill, free, wall
from sitl.generators.graded_posts import graded, room_at
from sitl.generators.posts import WEST_M, lattice_shape, smooth, stand
from sitl.generators.shortest_way import BODY_M, Place
from sitl.world.world import Obstacles

NARROWEST_M = 1.3
"""Of what a parameter may say: everywhere a way with 0.6 m on both sides is asked for."""
Rectangle = tuple[float, float, float, float]
"""Metres: its south and west edge, height and width."""


class GroundKind(StrEnum):
    """What the ground is like."""

    CLUTTER = "clutter"
    ROOMS = "rooms"
    YARD = "yard"
    MAZE = "maze"
    FOREST = "forest"
    CROPS = "crops"
    WAREHOUSE = "warehouse"
    CYLINDERS = "cylinders"


def is_kind(world: str) -> bool:
    """Whether this names a kind of ground, one's own as well, and not a file."""
    return world in set(GroundKind) or ("/" not in world and looks_own(OwnKind.WORLD, world))


class Parameters(BaseModel, ABC):
    """What a kind may be told; it draws the ground."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        values = self.model_dump()
        for name, most in values.items():
            least = values.get(name.replace("most_", "least_", 1)) if name.startswith("most_") else None
            if least is not None and least > most:
                raise ValueError(f"{name} {most:g} is less than least_{name[5:]} {least:g}")
        return self

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Obstacles:
        """Where something stands, on fields of ``FINE_M`` from the south-west corner: see ``canvas``."""

    def between(self, solid: Obstacles, start_m: Place, goal_m: Place, rng: np.random.Generator) -> Obstacles:
        """What was drawn, now that the ends are known; by default as it is."""
        return solid

    @property
    def beside_m(self) -> float:
        """There is a way with so much room on both sides."""
        return BODY_M


class Clutter(Parameters):
    """Boxes and posts."""

    least_things: int = Field(90, ge=0, le=400, description="boxes and posts")
    most_things: int = Field(149, ge=0, le=400, description="boxes and posts")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``."""
        solid = empty()
        for _ in range(int(rng.integers(self.least_things, self.most_things + 1))):
            north_m, east_m = rng.uniform((0.0, 6.0), (NORTH_M, EAST_M - 6.0))
            if rng.random() < 0.5:
                fill(solid, north_m, east_m, *rng.uniform(0.4, 2.5, 2))
            else:
                disc(solid, north_m, east_m, rng.uniform(0.15, 1.0))
        return solid


class Rooms(Parameters):
    """Walls of a building, with doors."""

    least_door_m: float = Field(
        1.3, ge=NARROWEST_M, le=5.0, description="width of doors; narrower than 1.5 m seldom has a way"
    )
    most_door_m: float = Field(2.0, ge=NARROWEST_M, le=5.0, description="width of doors")
    room_m: float = Field(9.0, ge=5.0, le=20.0, description="rooms as long as this are divided again")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """Halved again and again by walls, each with a door or two."""
        solid, doors_m = empty(), (self.least_door_m, self.most_door_m)
        areas = [(0.0, 5.0, NORTH_M, EAST_M - 10.0)]
        wall(solid, rng, 0.0, 5.0, NORTH_M, doors_m, along_north=True)
        wall(solid, rng, 0.0, EAST_M - 5.0, NORTH_M, doors_m, along_north=True)
        while areas:
            south_m, west_m, height_m, width_m = areas.pop()
            if max(height_m, width_m) < self.room_m:
                continue
            share = rng.uniform(0.4, 0.6)
            if height_m > width_m:
                cut_m = share * height_m
                wall(solid, rng, south_m + cut_m, west_m, width_m, doors_m, along_north=False)
                areas += [(south_m, west_m, cut_m, width_m), (south_m + cut_m, west_m, height_m - cut_m, width_m)]
            else:
                cut_m = share * width_m
                wall(solid, rng, south_m, west_m + cut_m, height_m, doors_m, along_north=True)
                areas += [(south_m, west_m, height_m, cut_m), (south_m, west_m + cut_m, height_m, width_m - cut_m)]
        return solid


class Yard(Parameters):
    """Fences across the way, with gates, and containers between them; on request a house and hedges."""

    least_gate_m: float = Field(
        1.3, ge=NARROWEST_M, le=5.0, description="width of gates; narrower than 1.5 m seldom has a way"
    )
    most_gate_m: float = Field(2.0, ge=NARROWEST_M, le=5.0, description="width of gates")
    most_containers: int = Field(3, ge=1, le=8, description="between two fences")
    house: int = Field(0, ge=0, le=2, description="houses without a door, each between two fences")
    house_long_m: float = Field(8.0, ge=3.0, le=16.0, description="length of a house, along the fences")
    house_wide_m: float = Field(4.5, ge=2.0, le=5.0, description="width of a house, from fence to fence")
    hedges: int = Field(0, ge=0, le=4, description="each along the east side of a fence; its gates stay open")
    hedge_m: float = Field(0.8, ge=0.3, le=1.5, description="thickness of hedges")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``. House and hedges have random numbers of their own: the fences stay where they were."""
        solid, fences_m, containers = empty(), [float(rng.uniform(8.0, 11.0))], list[Rectangle]()
        while fences_m[-1] < EAST_M - 7.0:
            east_m = fences_m[-1]
            wall(solid, rng, 0.0, east_m, NORTH_M, (self.least_gate_m, self.most_gate_m), along_north=True)
            following_m = east_m + float(rng.uniform(7.0, 11.0))
            for _ in range(int(rng.integers(1, self.most_containers + 1))):
                south_m, west_m = rng.uniform((0.0, east_m + 2.5), (NORTH_M - 6.0, east_m + 4.0))
                containers.append((south_m, west_m, *((2.4, 1.2) if rng.random() < 0.5 else (6.0, 2.4))))
            fences_m.append(following_m)
        own_rng = rng.spawn(1)[0]
        houses = self._houses(own_rng, fences_m[:-1])
        for rectangle in (*houses, *(one for one in containers if not any(_meet(one, house) for house in houses))):
            fill(solid, *rectangle)
        for east_m in own_rng.permutation(fences_m[:-1])[: self.hedges]:
            fence, hedge = area(0.0, east_m, NORTH_M, FINE_M), area(0.0, east_m + 0.2, NORTH_M, self.hedge_m)
            solid[hedge] |= solid[fence]
        return solid

    def _houses(self, rng: np.random.Generator, fences_m: list[float]) -> list[Rectangle]:
        """Each in the middle between two fences that stand."""
        between = list(pairwise(fences_m))
        chosen = rng.permutation(len(between))[: self.house]
        souths_m = rng.uniform(2.0, NORTH_M - 2.0 - self.house_long_m, len(chosen))
        return [
            (south_m, 0.5 * (sum(between[number]) + 0.2 - self.house_wide_m), self.house_long_m, self.house_wide_m)
            for number, south_m in zip(chosen, souths_m, strict=True)
        ]


def _meet(one: Rectangle, other: Rectangle) -> bool:
    """Whether there is less room than ``NARROWEST_M`` between two rectangles."""
    return all(
        one[axis] < other[axis] + other[axis + 2] + NARROWEST_M
        and other[axis] < one[axis] + one[axis + 2] + NARROWEST_M
        for axis in (0, 1)
    )


class Maze(Parameters):
    """Corridors without a plan: dead ends everywhere."""

    corridor_m: float = Field(3.0, ge=1.6, le=8.0, description="width of corridors, walls of 0.2 m included")
    loops: float = Field(0.1, ge=0.0, le=1.0, description="share of inner walls that are taken away again")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """Depth first from cell to cell; every cell is reached."""
        step_m, solid = self.corridor_m, empty()
        rows, columns = int(NORTH_M // step_m), int((EAST_M - 8.0) // step_m)
        west_m, south_m = 0.5 * (EAST_M - columns * step_m), 0.5 * (NORTH_M - rows * step_m)
        opened = _opened(rng, rows, columns, self.loops)
        for row in range(rows + 1):
            for column in range(columns + 1):
                place = south_m + row * step_m, west_m + column * step_m
                if column < columns and ((row - 1, column), (row, column)) not in opened:
                    fill(solid, place[0], place[1], 0.2, step_m + 0.2)
                if row < rows and ((row, column - 1), (row, column)) not in opened:
                    fill(solid, place[0], place[1], step_m + 0.2, 0.2)
        for east_m in (west_m, west_m + columns * step_m):
            row = int(rng.integers(rows))
            free(solid, south_m + row * step_m + 0.2, east_m, step_m - 0.2, 0.2)
        return solid


def _opened(rng: np.random.Generator, rows: int, columns: int, loops: float) -> set[tuple[Any, Any]]:
    """Pairs of neighbouring cells, the more southern or western first, between which there is no wall."""
    opened: set[tuple[Any, Any]] = set()
    seen, way = {(0, 0)}, [(0, 0)]
    while way:
        row, column = way[-1]
        nexts = [
            (row + dy, column + dx)
            for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0))
            if 0 <= row + dy < rows and 0 <= column + dx < columns and (row + dy, column + dx) not in seen
        ]
        if not nexts:
            way.pop()
            continue
        chosen = nexts[int(rng.integers(len(nexts)))]
        opened.add((min((row, column), chosen), max((row, column), chosen)))
        seen.add(chosen)
        way.append(chosen)
    for row in range(rows):
        for column in range(columns):
            for other in ((row + 1, column), (row, column + 1)):
                if other[0] < rows and other[1] < columns and rng.random() < loops:
                    opened.add(((row, column), other))
    return opened


class Forest(Parameters):
    """Trunks."""

    per_100_m2: float = Field(9.0, ge=0.0, le=30.0, description="trees")
    least_radius_m: float = Field(0.08, ge=0.05, le=1.0, description="of trunks")
    most_radius_m: float = Field(0.35, ge=0.05, le=1.0, description="of trunks")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``."""
        solid = empty()
        for _ in range(int(rng.poisson(self.per_100_m2 * NORTH_M * (EAST_M - 8.0) / 100.0))):
            north_m, east_m = rng.uniform((0.0, 4.0), (NORTH_M, EAST_M - 4.0))
            disc(solid, north_m, east_m, rng.uniform(self.least_radius_m, self.most_radius_m))
        return solid


class Crops(Parameters):
    """Rows of plants across the way, with headlands on both sides and gaps where plants have failed."""

    row_m: float = Field(2.0, ge=1.5, le=6.0, description="from row to row")
    plant_m: float = Field(0.3, ge=0.1, le=1.0, description="diameter of plants")
    gaps: float = Field(0.02, ge=0.0, le=0.3, description="share of places along a row at which 2.5 m have failed")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """Rows run north: to cross them the rover looks for gaps, or drives round on the headland."""
        solid = empty()
        east_m = 9.0
        while east_m < EAST_M - 9.0:
            north_m = float(rng.uniform(3.0, 4.0))
            last_m = NORTH_M - float(rng.uniform(3.0, 4.0))
            while north_m < last_m:
                disc(solid, north_m, east_m + rng.uniform(-0.1, 0.1), 0.5 * self.plant_m)
                north_m += 2.5 if rng.random() < self.gaps else 0.8 * self.plant_m
            east_m += self.row_m
        return solid


class Warehouse(Parameters):
    """Racks in rows, with aisles between them and across; some pallets stand in the aisles."""

    aisle_m: float = Field(2.4, ge=1.6, le=6.0, description="width of aisles")
    rack_m: float = Field(8.0, ge=2.0, le=20.0, description="length of racks")
    pallets: int = Field(8, ge=0, le=60, description="of 1.2 x 0.8 m, in the aisles")

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``."""
        solid = empty()
        south_m = 1.5
        while south_m + 1.1 < NORTH_M - 1.0:
            east_m = 7.0 + float(rng.uniform(0.0, 1.5))
            while east_m + self.rack_m < EAST_M - 6.0:
                fill(solid, south_m, east_m, 1.1, self.rack_m)
                east_m += self.rack_m + self.aisle_m
            south_m += 1.1 + self.aisle_m
        for _ in range(self.pallets):
            north_m, east_m = rng.uniform((1.0, 7.0), (NORTH_M - 2.0, EAST_M - 8.0))
            fill(solid, north_m, east_m, *((1.2, 0.8) if rng.random() < 0.5 else (0.8, 1.2)))
        return solid


class Cylinders(Parameters):
    """Fields of posts of the kind of BARN: a cellular automaton fills a lattice and smooths it."""

    filled: float = Field(0.12, ge=0.0, le=0.3, description="share of the lattice that is filled at first")
    smoothed: int = Field(1, ge=0, le=4, description="rounds of the automaton")
    step_m: float = Field(0.4, ge=0.15, le=1.0, description="side of a cell of the lattice; a post is half as wide")
    difficulty: float = Field(
        0.0, ge=0.0, le=1.0, description="how hard; `filled` is searched for it. 0: `filled` counts as it is given"
    )

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``."""
        if self.difficulty > 0.0:
            return empty()
        return stand(smooth(rng.random(lattice_shape(self.step_m, WEST_M)) < self.filled, self.smoothed), self.step_m)

    def between(self, solid: Obstacles, start_m: Place, goal_m: Place, rng: np.random.Generator) -> Obstacles:
        """See ``Parameters``."""
        if self.difficulty <= 0.0:
            return solid
        return graded(self.difficulty, self.step_m, self.smoothed, (start_m, goal_m), rng)

    @property
    def beside_m(self) -> float:
        """See ``Parameters``."""
        return room_at(self.difficulty)


KINDS: dict[GroundKind, type[Parameters]] = {
    GroundKind.CLUTTER: Clutter,
    GroundKind.ROOMS: Rooms,
    GroundKind.YARD: Yard,
    GroundKind.MAZE: Maze,
    GroundKind.FOREST: Forest,
    GroundKind.CROPS: Crops,
    GroundKind.WAREHOUSE: Warehouse,
    GroundKind.CYLINDERS: Cylinders,
}
"""Each kind's parameters, which draw it."""


def parameters_of(kind: str) -> type[Parameters]:
    """The parameters of a kind of this name. Raises OwnPartError for one's own that is none."""
    if kind in set(GroundKind):
        return KINDS[GroundKind(kind)]
    own = own_part(OwnKind.WORLD, kind)
    if not (isinstance(own, type) and issubclass(own, Parameters)):
        raise OwnPartError(f"world {kind!r:.80} is no class of sitl.generators.kinds.Parameters; see docs/worlds.md")
    return own


def stream_of(kind: str) -> int:
    """The number that separates the random draws of a kind from those of others with the same seed."""
    return list(GroundKind).index(GroundKind(kind)) if kind in set(GroundKind) else zlib.crc32(kind.encode())
