"""Sensor agreement: the cells in which a sensor has just seen something, which no other sensor may free.

Nouns: sensor agreement.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from companion.core.scan import RangeScan

BELIEVED_S = 1.0
"""For this long after a reading only its own sensor may free the cell again: the slowest in use send once a second."""
NONE = np.empty((0, 2), np.int64)

Cells = NDArray[np.int64]
"""Evidence cells, shape (n, 2): x and y."""


class _Hits:
    """Those of one scan. Most rovers have one sensor, and none of their cells is ever asked for."""

    def __init__(self, scan: RangeScan, find: Callable[[], Cells]) -> None:
        self.time_s, self.voice = scan.time_s, scan.voice
        self._find = find

    @cached_property
    def cells(self) -> Cells:
        """Where they are."""
        return self._find()


class SensorAgreement:
    """The hits of the newest second, by the sensor that saw them."""

    def __init__(self) -> None:
        self._seen: deque[_Hits] = deque()

    def note(self, scan: RangeScan, find: Callable[[], Cells]) -> None:
        """One more scan. ``find`` tells in which cells its readings have ended, also later."""
        self._seen.append(_Hits(scan, find))

    def others(self, scan: RangeScan) -> Cells:
        """The cells in which other sensors than the one of this scan have just seen something."""
        while self._seen and self._seen[0].time_s < scan.time_s - BELIEVED_S:
            self._seen.popleft()
        own = scan.voice
        cells = [hits.cells for hits in self._seen if hits.voice != own]
        return np.concatenate(cells) if cells else NONE

    def clear(self) -> None:
        """Forget all: what has been seen lies elsewhere now."""
        self._seen.clear()
