"""Map tiles: the map as a person sees it, in square pieces, and which of them have changed.

Nouns: map tile, tile watch.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.settings import Settings
from companion.viewer.tile_kernels import MOST_RUN, classify, write_runs
from companion.viewer.wire import Place

TILE = 64
"""Cells along a side."""
MOST_NEAR = 12
"""Tiles within the sensors' reach that are looked at each time."""
GLANCES, AT_ONCE = 40, 12
"""Tiles that are looked at for the first time each time, until so many of them hold something."""
IN_TURN = 4
"""Tiles that the map may have forgotten meanwhile, looked at each time."""
NOT_TOLD = b""
"""Stands for a tile that could not be told: whoever looks may hold an older one."""

Tile = NDArray[np.uint8]


def warm_up() -> None:
    """Run the compiled loops once, with the types that a run uses."""
    evidence = new_map(empty_grid(8, 8), 0.35, Settings().mapping)
    evidence.log_odds[:] = 3.0
    TileWatch(evidence).changed(evidence, NedPoint(4.0, 4.0), 1.0)


def cell_classes(evidence: EvidenceMap, x0: int, y0: int, x1: int, y1: int) -> Tile:
    """What the evidence cells x0 <= x < x1, y0 <= y < y1 are, shape (y1 - y0, x1 - x0). They must be on the map."""
    classes = np.empty((y1 - y0, x1 - x0), np.uint8)
    _classify(evidence, x0, y0, classes)
    return classes


def run_lengths(cells: Tile) -> bytes:
    """Cells row by row as runs: a byte is its class times 32 and its length less 1."""
    runs = np.empty(cells.size, np.uint8)
    return runs[: write_runs(cells.ravel(), runs)].tobytes()


def cells_of(runs: bytes) -> Tile:
    """The cells of ``run_lengths``, in one row."""
    values = np.frombuffer(runs, np.uint8)
    return np.repeat(values >> 5, (values & (MOST_RUN - 1)).astype(np.intp) + 1)


class TileWatch:
    """Knows the tiles of one map as they were last told. A tile that never held anything is not told.

    Each look takes those round the rover, some of those that nobody has looked at yet, the nearest first, and a few
    others in turn: so it takes less than a millisecond, however large the map is and however far the sensor sees.
    """

    def __init__(self, evidence: EvidenceMap) -> None:
        height, width = evidence.log_odds.shape
        self._size = math.ceil(width / TILE), math.ceil(height / TILE)
        self._told: dict[Place, bytes] = {}
        """The cells of each."""
        self._waiting: list[Place] = []
        """Those that nobody has looked at yet, the next one last."""
        self._all_wait = True
        """None has been looked at yet, and ``_waiting`` is still to be made."""
        self._in_turn: deque[Place] = deque()
        self._far_at = 0

    @property
    def is_behind(self) -> bool:
        """Whether there are tiles that nobody has looked at yet."""
        return self._all_wait or bool(self._waiting)

    def tell_again(self, places: Iterable[Place] | None = None) -> None:
        """These were not told after all; None: whoever was told anything has forgotten it."""
        if places is not None:
            again = list(places)
            self._told.update((place, NOT_TOLD) for place in again)
            self._waiting.extend(again)
            return
        self._told.clear()
        self._in_turn.clear()
        self._all_wait = True

    def changed(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> list[tuple[Place, bytes]]:
        """The tiles that differ from what was told, with their cells in runs."""
        x, y = evidence.frame.xy(around)
        middle = x / TILE - 0.5, y / TILE - 0.5
        if self._all_wait:
            self._waiting, self._all_wait = self._farthest_first(middle), False
        places = self._nearest(self._places_around(evidence, around, reach_m), middle)
        for _ in range(min(IN_TURN, len(self._in_turn))):
            places.add(self._in_turn[0])
            self._in_turn.rotate(-1)
        news = [one for place in sorted(places) if (one := self._news(evidence, place)) is not None]
        most = len(news) + AT_ONCE
        for _ in range(min(GLANCES, len(self._waiting))):
            if len(news) < most and (one := self._news(evidence, self._waiting.pop())) is not None:
                news.append(one)
        return news

    def _news(self, evidence: EvidenceMap, place: Place) -> tuple[Place, bytes] | None:
        """A tile, if it is not as it was told; it counts as told then."""
        tile, known = _tile(evidence, place)
        if not known and place not in self._told:
            return None
        cells = tile.tobytes()
        if self._told.get(place) == cells:
            return None
        if place not in self._told:
            self._in_turn.append(place)
        self._told[place] = cells
        return place, run_lengths(tile)

    def _farthest_first(self, middle: tuple[float, float]) -> list[Place]:
        """All tiles. ``middle``: where the rover is, in tiles."""
        columns, rows = (axis.ravel() for axis in np.meshgrid(*map(np.arange, self._size)))
        order = np.argsort(np.hypot(columns - middle[0], rows - middle[1]), kind="stable")[::-1]
        return list(zip(columns[order].tolist(), rows[order].tolist(), strict=True))

    def _nearest(self, near: set[Place], middle: tuple[float, float]) -> set[Place]:
        """Of many the nearest, and some of the others in turn. ``middle``: where the rover is, in tiles."""
        if len(near) <= MOST_NEAR:
            return near
        ordered = sorted(near, key=lambda place: (math.dist(place, middle), place))
        half = MOST_NEAR // 2
        far = ordered[half:]
        self._far_at = (self._far_at + half) % len(far)
        return {*ordered[:half], *(far + far)[self._far_at : self._far_at + half]}

    def _places_around(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> set[Place]:
        frame = evidence.frame
        (x, y), reach = frame.xy(around), frame.cells(reach_m)
        columns, rows = self._size
        first_x, last_x = (min(max(int((x + side) // TILE), 0), columns - 1) for side in (-reach, reach))
        first_y, last_y = (min(max(int((y + side) // TILE), 0), rows - 1) for side in (-reach, reach))
        return {(column, row) for column in range(first_x, last_x + 1) for row in range(first_y, last_y + 1)}


def _tile(evidence: EvidenceMap, place: Place) -> tuple[Tile, bool]:
    """The cells of one tile, and whether any is known; beyond the edge of the map they are unknown."""
    tile = np.zeros((TILE, TILE), np.uint8)
    return tile, _classify(evidence, place[0] * TILE, place[1] * TILE, tile)


def _classify(evidence: EvidenceMap, x0: int, y0: int, classes: Tile) -> bool:
    occupied_at, weights = evidence.settings.occupied_at, evidence.base.weights
    return bool(classify(evidence.log_odds, weights, evidence.subdivisions, occupied_at, x0, y0, classes))
