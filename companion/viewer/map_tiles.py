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
from companion.core.grid import BASE_WEIGHT, OBSTACLE
from companion.mapping.evidence_map import EvidenceMap
from companion.viewer.wire import Place

TILE = 64
"""Cells along a side."""
UNKNOWN, FREE, SEEN_OBSTACLE, CLOSED, COSTLY = range(5)
"""What a cell is. ``CLOSED``: by a fence, the mission or a known map; ``COSTLY``: ground that the mission calls so."""
MOST_RUN = 32
"""A run's length takes five bits of its byte, what it is made of the other three."""
MOST_NEAR = 24
"""Tiles within the sensors' reach that are looked at each time."""
AT_ONCE, IN_TURN = 16, 8
"""Tiles out of the sensors' reach that are looked at each time: for the first time, and those that the map may have
forgotten meanwhile."""

Tile = NDArray[np.uint8]


def cell_classes(evidence: EvidenceMap, x0: int, y0: int, x1: int, y1: int) -> Tile:
    """What the evidence cells x0 <= x < x1, y0 <= y < y1 are, shape (y1 - y0, x1 - x0). They must be on the map."""
    s = evidence.subdivisions
    found = evidence.log_odds[y0:y1, x0:x1]
    rows, columns = np.arange(y0, y1) // s, np.arange(x0, x1) // s
    base = evidence.base.weights[np.ix_(rows, columns)]
    classes = np.where(found < 0.0, FREE, UNKNOWN).astype(np.uint8)
    classes[(base > BASE_WEIGHT) & (base < OBSTACLE)] = COSTLY
    classes[base >= OBSTACLE] = CLOSED
    classes[found >= evidence.settings.occupied_at] = SEEN_OBSTACLE
    return classes


def run_lengths(cells: Tile) -> bytes:
    """Cells row by row as runs: a byte is its class times 32 and its length less 1."""
    flat = cells.ravel()
    begins = np.flatnonzero(np.concatenate(([True], flat[1:] != flat[:-1])))
    lengths = np.diff(np.concatenate((begins, [flat.size])))
    whole, rest = np.divmod(lengths, MOST_RUN)
    pieces = []
    for kind, full, left in zip(flat[begins].tolist(), whole.tolist(), rest.tolist(), strict=True):
        pieces.append(bytes([kind << 5 | (MOST_RUN - 1)]) * full + (bytes([kind << 5 | (left - 1)]) if left else b""))
    return b"".join(pieces)


def cells_of(runs: bytes) -> Tile:
    """The cells of ``run_lengths``, in one row."""
    values = np.frombuffer(runs, np.uint8)
    return np.repeat(values >> 5, (values & (MOST_RUN - 1)).astype(np.intp) + 1)


class TileWatch:
    """Knows the tiles of one map as they were last told. A tile that never held anything is not told.

    Each look takes those round the rover, some of those that nobody has looked at yet, and a few others in turn: so it
    takes milliseconds, however large the map is and however far the sensor sees.
    """

    def __init__(self, evidence: EvidenceMap) -> None:
        height, width = evidence.log_odds.shape
        self._size = math.ceil(width / TILE), math.ceil(height / TILE)
        self._told: dict[Place, bytes] = {}
        """The cells of each."""
        self._waiting: deque[Place] = deque()
        self._in_turn: deque[Place] = deque()
        self._far_at = 0
        self.tell_again()

    @property
    def is_behind(self) -> bool:
        """Whether there are tiles that nobody has looked at yet."""
        return bool(self._waiting)

    def tell_again(self, places: Iterable[Place] | None = None) -> None:
        """These were not told after all; None: whoever was told anything has forgotten it."""
        columns, rows = self._size
        everywhere = ((column, row) for row in range(rows) for column in range(columns))
        again = list(everywhere if places is None else places)
        for place in again:
            self._told.pop(place, None)
        self._waiting.extend(again)

    def changed(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> list[tuple[Place, bytes]]:
        """The tiles that differ from what was told, with their cells in runs."""
        places = self._nearest(evidence, around, reach_m)
        places.update(self._waiting.popleft() for _ in range(min(AT_ONCE, len(self._waiting))))
        for _ in range(min(IN_TURN, len(self._in_turn))):
            places.add(self._in_turn[0])
            self._in_turn.rotate(-1)
        news = []
        for place in sorted(places):
            tile = _tile(evidence, place)
            cells = tile.tobytes()
            if self._told.get(place, EMPTY) == cells:
                continue
            if place not in self._told:
                self._in_turn.append(place)
            self._told[place] = cells
            news.append((place, run_lengths(tile)))
        return news

    def _nearest(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> set[Place]:
        """Those within the sensors' reach; of many the nearest, and some of the others in turn."""
        near = self._places_around(evidence, around, reach_m)
        if len(near) <= MOST_NEAR:
            return near
        x, y = evidence.frame.xy(around)
        middle = x / TILE - 0.5, y / TILE - 0.5
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


def _tile(evidence: EvidenceMap, place: Place) -> Tile:
    """The cells of one tile; beyond the edge of the map they are unknown."""
    height, width = evidence.log_odds.shape
    x0, y0 = place[0] * TILE, place[1] * TILE
    x1, y1 = min(x0 + TILE, width), min(y0 + TILE, height)
    tile = np.zeros((TILE, TILE), np.uint8)
    tile[: y1 - y0, : x1 - x0] = cell_classes(evidence, x0, y0, x1, y1)
    return tile


EMPTY = bytes(TILE * TILE)
