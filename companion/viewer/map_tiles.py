"""Map tiles: the map as a person sees it, in square pieces, and which of them have changed.

Nouns: map tile, tile watch.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE
from companion.mapping.evidence_map import EvidenceMap

TILE = 64
"""Cells along a side."""
UNKNOWN, FREE, SEEN_OBSTACLE, CLOSED, COSTLY = range(5)
"""What a cell is. ``CLOSED``: by a fence, the mission or a known map; ``COSTLY``: ground that the mission calls so."""
MAGIC = b"TIL1"
MOST_RUN = 32
"""A run's length takes five bits of its byte, what it is made of the other three."""
IN_TURN = 8
"""Tiles out of the sensors' reach that are looked at each time: the mission's own, and what was forgotten."""

Tile = NDArray[np.uint8]
Place = tuple[int, int]
"""Column and row of a tile, from the map's south-west corner."""


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


def run_lengths_of(tiles: Mapping[Place, bytes]) -> Iterator[tuple[Place, bytes]]:
    """The cells of whole tiles as runs."""
    for place, cells in tiles.items():
        yield place, run_lengths(np.frombuffer(cells, np.uint8))


def cells_of(runs: bytes) -> Tile:
    """The cells of ``run_lengths``, in one row."""
    values = np.frombuffer(runs, np.uint8)
    return np.repeat(values >> 5, (values & (MOST_RUN - 1)).astype(np.intp) + 1)


def message_of(tiles: Iterable[tuple[Place, bytes]]) -> bytes:
    """The binary message of some tiles: column, row and length as 16-bit numbers, then the runs."""
    return MAGIC + b"".join(struct.pack("<HHH", *place, len(runs)) + runs for place, runs in tiles)


def tiles_in(message: bytes) -> Iterator[tuple[Place, bytes]]:
    """The tiles of a message."""
    at = len(MAGIC)
    while at < len(message):
        column, row, length = struct.unpack_from("<HHH", message, at)
        at += 6
        yield (column, row), message[at : at + length]
        at += length


class TileWatch:
    """Knows the tiles of one map as they were last told. A tile that never held anything is not told."""

    def __init__(self, evidence: EvidenceMap) -> None:
        height, width = evidence.log_odds.shape
        self._size = math.ceil(width / TILE), math.ceil(height / TILE)
        self._told: dict[Place, bytes] = {}
        """The cells of each."""
        self._in_turn = deque(_places_with_something(evidence))
        self._known = set(self._in_turn)

    @property
    def told(self) -> dict[Place, bytes]:
        """The cells of each tile that has been told."""
        return self._told

    def forget(self, places: Iterable[Place]) -> None:
        """These were not told after all."""
        for place in places:
            self._told.pop(place, None)

    def changed(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> list[tuple[Place, bytes]]:
        """The tiles that differ from what was told: round a place, and a few of the others in turn."""
        places = self._places_around(evidence, around, reach_m)
        for _ in range(min(IN_TURN, len(self._in_turn))):
            places.add(self._in_turn[0])
            self._in_turn.rotate(-1)
        news = []
        for place in sorted(places):
            tile = _tile(evidence, place)
            cells = tile.tobytes()
            if self._told.get(place, EMPTY) == cells:
                continue
            if place not in self._known:
                self._known.add(place)
                self._in_turn.append(place)
            self._told[place] = cells
            news.append((place, run_lengths(tile)))
        return news

    def _places_around(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> set[Place]:
        frame = evidence.frame
        (x, y), reach = frame.xy(around), frame.cells(reach_m)
        columns, rows = self._size
        first_x, last_x = (min(max(int((x + side) // TILE), 0), columns - 1) for side in (-reach, reach))
        first_y, last_y = (min(max(int((y + side) // TILE), 0), rows - 1) for side in (-reach, reach))
        return {(column, row) for column in range(first_x, last_x + 1) for row in range(first_y, last_y + 1)}


def _places_with_something(evidence: EvidenceMap) -> list[Place]:
    """Where the mission itself says something of the ground, or an earlier run has seen something."""
    s = evidence.subdivisions
    field_y, field_x = np.nonzero(evidence.base.weights > BASE_WEIGHT)
    seen_y, seen_x = np.nonzero(evidence.log_odds)
    corners = [(field_x * s, field_y * s), (field_x * s + s - 1, field_y * s + s - 1), (seen_x, seen_y)]
    places = np.concatenate([np.column_stack((x // TILE, y // TILE)) for x, y in corners])
    return [(int(column), int(row)) for column, row in np.unique(places, axis=0)]


def _tile(evidence: EvidenceMap, place: Place) -> Tile:
    """The cells of one tile; beyond the edge of the map they are unknown."""
    height, width = evidence.log_odds.shape
    x0, y0 = place[0] * TILE, place[1] * TILE
    x1, y1 = min(x0 + TILE, width), min(y0 + TILE, height)
    tile = np.zeros((TILE, TILE), np.uint8)
    tile[: y1 - y0, : x1 - x0] = cell_classes(evidence, x0, y0, x1, y1)
    return tile


EMPTY = bytes(TILE * TILE)
