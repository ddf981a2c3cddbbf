"""Sensor agreement: the cells in which a sensor has just seen something.

No other sensor may free them, and they confirm what is seen beside them.

Nouns: sensor agreement.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.scan import RangeScan

BELIEVED_S = 1.0
"""For this long a reading counts, and only its own sensor may free the cell again: the slowest in use send once a
second."""
NONE = np.empty((0, 2), np.int64)

Cells = NDArray[np.int64]
"""Evidence cells, shape (n, 2): x and y."""


@dataclass(frozen=True, slots=True, eq=False)
class _Hits:
    """Those of one scan."""

    time_s: float
    voice: tuple[int, str]
    cells: Cells


class SensorAgreement:
    """The hits of the newest second, by the sensor that saw them."""

    def __init__(self) -> None:
        self._seen: deque[_Hits] = deque()

    def note(self, scan: RangeScan, cells: Cells) -> None:
        """One more scan, and the cells in which its readings have ended."""
        while self._seen and self._seen[0].time_s < scan.time_s - BELIEVED_S:
            self._seen.popleft()
        self._seen.append(_Hits(scan.time_s, scan.voice, cells))

    def before(self, scan: RangeScan) -> Cells:
        """The cells in which any sensor has just seen something."""
        return self._of(scan, own=True)

    def others(self, scan: RangeScan) -> Cells:
        """The cells in which other sensors than the one of this scan have just seen something."""
        return self._of(scan, own=False)

    def _of(self, scan: RangeScan, own: bool) -> Cells:
        since_s = scan.time_s - BELIEVED_S
        cells = [hits.cells for hits in self._seen if hits.time_s >= since_s and (own or hits.voice != scan.voice)]
        return np.concatenate(cells) if cells else NONE

    def clear(self) -> None:
        """Forget all: what has been seen lies elsewhere now."""
        self._seen.clear()
