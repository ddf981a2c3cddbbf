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
NEAR_A_SECOND = 100
"""Tiles that are looked at each second of those within the sensors' reach, and of those that were when they were looked
at last."""
CLOSE = 2
"""Half of them are at most so many tiles away from where the rover is: these are looked at more often."""
GLANCES_A_SECOND, TOLD_A_SECOND = 800, 240
"""Tiles that are looked at for the first time each second, until so many of them hold something."""
IN_TURN_A_SECOND = 16
"""Tiles that the map may have forgotten meanwhile, looked at each second."""
FARTHER_M = 1.0
"""Between two calls the rover may have been so much nearer to what it saw."""
NOT_TOLD = b""
"""Stands for a tile that could not be told: whoever looks may hold an older one."""

Tile = NDArray[np.uint8]
Span = tuple[int, int, int, int]
"""The first and the last column, the first and the last row."""


def warm_up() -> None:
    """Run the compiled loops once, with the types that a run uses."""
    evidence = new_map(empty_grid(8, 8), 0.35, Settings().mapping)
    evidence.log_odds[:] = 3.0
    TileWatch(evidence).changed(evidence, NedPoint(4.0, 4.0), 1.0, math.inf)


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


class Turn:
    """Places that are looked at in turn."""

    def __init__(self) -> None:
        self._places: deque[Place] = deque()

    def __len__(self) -> int:
        """How many there are."""
        return len(self._places)

    def keep(self, places: set[Place]) -> None:
        """These from now on: those that are new come first."""
        new = places.difference(self._places)
        self._places = deque([*sorted(new), *(place for place in self._places if place in places)])

    def add(self, place: Place) -> None:
        """One more."""
        self._places.append(place)

    def clear(self) -> None:
        """None any more."""
        self._places.clear()

    def take(self, count: int) -> list[Place]:
        """The next ones; they come last then."""
        count = min(count, len(self._places))
        taken = [self._places[at] for at in range(count)]
        self._places.rotate(-count)
        return taken


class TileWatch:
    """Knows the tiles of one map as they were last told. A tile that never held anything is not told.

    Each look takes tiles round the rover in turn, those that have gone out of reach since, some that nobody has looked
    at yet, the nearest first, and a few others in turn, as many as are due: so it takes about a millisecond, however
    large the map is and however far the sensor sees. What was in reach is looked at once more when it is no longer.
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
        self._spans: tuple[Span, Span] | None = None
        """The rover's own tile, and those within reach."""
        self._close, self._far, self._in_turn = Turn(), Turn(), Turn()
        self._left: dict[Place, None] = {}
        """Those that have gone out of reach since they were looked at, the next one first."""

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

    def note(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> None:
        """Something may change within reach of the rover. To be called often, also while nothing can be told."""
        spans = self._span(evidence, around, 0.0), self._span(evidence, around, reach_m + FARTHER_M)
        if spans == self._spans:
            return
        before = set() if self._spans is None else _places_in(self._spans[1])
        self._spans = spans
        (west, east, south, north), reached = spans[0], _places_in(spans[1])
        close = reached & _places_in((west - CLOSE, east + CLOSE, south - CLOSE, north + CLOSE))
        self._close.keep(close)
        self._far.keep(reached - close)
        left = dict.fromkeys([*self._left, *sorted(before - reached)])
        self._left = {place: None for place in left if place not in reached}

    def changed(
        self, evidence: EvidenceMap, around: NedPoint, reach_m: float, seconds: float
    ) -> list[tuple[Place, bytes]]:
        """The tiles that differ from what was told, with their cells in runs.

        ``seconds``: for so long no look was taken; inf: everything is looked at.
        """
        self.note(evidence, around, reach_m)
        if self._all_wait:
            x, y = evidence.frame.xy(around)
            self._waiting, self._all_wait = self._farthest_first((x / TILE - 0.5, y / TILE - 0.5)), False
        half = 0.5 * NEAR_A_SECOND * seconds
        places = set(self._close.take(_count(half, len(self._close))))
        left = [*self._left][: _count(half, len(self._left))]
        for place in left:
            del self._left[place]
        places.update(left, self._far.take(_count(half - len(left), len(self._far))))
        places.update(self._in_turn.take(_count(IN_TURN_A_SECOND * seconds, len(self._in_turn))))
        news = [one for place in sorted(places) if (one := self._news(evidence, place)) is not None]
        most = len(news) + _count(TOLD_A_SECOND * seconds, len(self._waiting))
        for _ in range(_count(GLANCES_A_SECOND * seconds, len(self._waiting))):
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
            self._in_turn.add(place)
        self._told[place] = cells
        return place, run_lengths(tile)

    def _farthest_first(self, middle: tuple[float, float]) -> list[Place]:
        """All tiles. ``middle``: where the rover is, in tiles."""
        columns, rows = (axis.ravel() for axis in np.meshgrid(*map(np.arange, self._size)))
        order = np.argsort(np.hypot(columns - middle[0], rows - middle[1]), kind="stable")[::-1]
        return list(zip(columns[order].tolist(), rows[order].tolist(), strict=True))

    def _span(self, evidence: EvidenceMap, around: NedPoint, reach_m: float) -> Span:
        frame = evidence.frame
        (x, y), reach = frame.xy(around), frame.cells(reach_m)
        columns, rows = self._size
        west, east = (min(max(int((x + side) // TILE), 0), columns - 1) for side in (-reach, reach))
        south, north = (min(max(int((y + side) // TILE), 0), rows - 1) for side in (-reach, reach))
        return west, east, south, north


def _places_in(span: Span) -> set[Place]:
    west, east, south, north = span
    return {(column, row) for column in range(west, east + 1) for row in range(south, north + 1)}


def _count(due: float, there: int) -> int:
    """So many of those that are there."""
    return math.ceil(max(min(due, there), 0.0))


def _tile(evidence: EvidenceMap, place: Place) -> tuple[Tile, bool]:
    """The cells of one tile, and whether any is known; beyond the edge of the map they are unknown."""
    tile = np.zeros((TILE, TILE), np.uint8)
    return tile, _classify(evidence, place[0] * TILE, place[1] * TILE, tile)


def _classify(evidence: EvidenceMap, x0: int, y0: int, classes: Tile) -> bool:
    occupied_at, weights = evidence.settings.occupied_at, evidence.base.weights
    return bool(classify(evidence.log_odds, weights, evidence.subdivisions, occupied_at, x0, y0, classes))
