"""Sensor agreement: the cells in which a sensor has just seen something, which no other sensor may free.

Nouns: sensor agreement.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.core.scan import RangeScan

BELIEVED_S = 1.0
"""For this long after a reading only its own sensor may free the cell again: the slowest in use send once a second."""
NONE = np.empty((0, 2), np.int64)

Cells = NDArray[np.int64]
"""Evidence cells, shape (n, 2): x and y."""


class SensorAgreement:
    """The hits of the newest second, by the sensor that saw them."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, tuple[int, str], Cells]] = deque()

    def note(self, scan: RangeScan, cells: Cells) -> None:
        """The readings of a scan have ended in these cells."""
        if len(cells):
            self._seen.append((scan.time_s, scan.voice, cells))

    def others(self, scan: RangeScan) -> Cells:
        """The cells in which other sensors than the one of this scan have just seen something."""
        while self._seen and self._seen[0][0] < scan.time_s - BELIEVED_S:
            self._seen.popleft()
        own = scan.voice
        cells = [cells for _, voice, cells in self._seen if voice != own]
        return np.concatenate(cells) if cells else NONE

    def clear(self) -> None:
        """Forget all: what has been seen lies elsewhere now."""
        self._seen.clear()
