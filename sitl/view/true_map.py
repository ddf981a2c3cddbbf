"""The true map: the world as it stands now, as map tiles for the page, and which of them a door has changed.

Nouns: true map.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.viewer.map_tiles import TILE, run_lengths
from companion.viewer.tile_kernels import CLOSED, COSTLY, FREE, SEEN_OBSTACLE
from companion.viewer.wire import Place
from sitl.world.world import World

AT_ONCE = 40
"""Tiles that are told at a time: no more than a few milliseconds of work."""

Classes = NDArray[np.uint8]


class TrueMap:
    """Doors are obstacles while they are shut and ``CLOSED`` while they are open, so that they can be seen then, too.

    Slippery and rough ground is ``COSTLY``.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._shut = self._doors(0.0)
        self._classes = self._made(0.0)
        self._waiting: deque[Place] = deque()
        self.tell_again()

    def tell_again(self) -> None:
        """Whoever was told has forgotten it."""
        rows, columns = self._classes.shape
        across, up = math.ceil(columns / TILE), math.ceil(rows / TILE)
        self._waiting = deque((column, row) for row in range(up) for column in range(across))

    def look(self, time_s: float) -> None:
        """Notice doors that have opened or closed."""
        shut = self._doors(time_s)
        if shut == self._shut:
            return
        before, self._shut, self._classes = self._classes, shut, self._made(time_s)
        rows, columns = np.nonzero(before != self._classes)
        changed = {(int(column), int(row)) for row, column in zip(rows // TILE, columns // TILE, strict=True)}
        self._waiting.extend(sorted(changed.difference(self._waiting)))

    def take(self) -> list[tuple[Place, bytes]]:
        """The next tiles, with their cells in runs."""
        places = [self._waiting.popleft() for _ in range(min(AT_ONCE, len(self._waiting)))]
        return [(place, run_lengths(self._tile(place))) for place in places]

    def put_back(self, tiles: list[tuple[Place, bytes]]) -> None:
        """These could not be told."""
        self._waiting.extendleft(place for place, _ in tiles)

    def _doors(self, time_s: float) -> tuple[bool, ...]:
        """Which doors are shut."""
        return tuple(not door.is_open(time_s) for door in self._world.doors)

    def _made(self, time_s: float) -> Classes:
        world = self._world
        classes = np.full(world.obstacles.shape, FREE, np.uint8)
        if world.ground.size:
            classes[(world.ground < 1.0).any(axis=0)] = COSTLY
        classes[world.obstacles] = SEEN_OBSTACLE
        for door, shut in zip(world.doors, self._doors(time_s), strict=True):
            classes[door.fields] = SEEN_OBSTACLE if shut else CLOSED
        return classes

    def _tile(self, place: Place) -> Classes:
        """The cells of one tile; beyond the edge of the world the ground is free."""
        x0, y0 = place[0] * TILE, place[1] * TILE
        cells = self._classes[y0 : y0 + TILE, x0 : x0 + TILE]
        tile = np.full((TILE, TILE), FREE, np.uint8)
        tile[: cells.shape[0], : cells.shape[1]] = cells
        return tile
