"""Seen rows: of each row of a raster, the columns between which anything may have been written.

What is done to a whole map then costs what was seen of it, not what it could hold.

Nouns: seen rows.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Cell

Window = tuple[slice, slice]
"""Rows and columns of a raster."""
STRIP = 16
"""Rows that are looked at together. More hold more that was not seen, of a drive that leads across the rows aslant."""


class SeenRows:
    """Of each row the first and the last column. It may hold more than was written, but never less."""

    def __init__(self, height: int, width: int) -> None:
        self._width = width
        self._first, self._last = np.full(height, width), np.full(height, -1)

    @classmethod
    def of(cls, raster: NDArray[np.generic]) -> SeenRows:
        """Of all that is not zero. It looks at the whole raster."""
        rows = cls(*raster.shape)
        _find(raster, rows._first, rows._last)
        return rows

    def add(self, x0: int, y0: int, x1: int, y1: int) -> None:
        """The cells x0 <= x < x1, y0 <= y < y1; they may lie outside."""
        rows, x0, x1 = slice(max(y0, 0), max(y1, 0)), max(x0, 0), min(x1, self._width)
        if x0 < x1:
            np.minimum(self._first[rows], x0, out=self._first[rows])
            np.maximum(self._last[rows], x1 - 1, out=self._last[rows])

    def span(self, y0: int, y1: int) -> tuple[int, int]:
        """The columns x0 <= x < x1 of the rows y0 <= y < y1, which may lie outside; both 0 for none."""
        rows = slice(max(y0, 0), max(y1, 0))
        first, last = self._first[rows], self._last[rows]
        if not len(first) or last.max() < 0:
            return 0, 0
        return int(first.min()), int(last.max()) + 1

    def windows(self, step: int = 1) -> Iterator[Window]:
        """Windows without common cells that hold all of it, in rows and columns that are whole multiples of ``step``.

        Height and width of the raster must be such multiples. Windows begin at the same rows, whatever was seen.
        """
        rows = max(STRIP // step, 1) * step
        for y in range(0, len(self._first), rows):
            x0, x1 = self.span(y, y + rows)
            if x0 < x1:
                yield slice(y, min(y + rows, len(self._first))), slice(x0 // step * step, -(-x1 // step) * step)

    def move(self, by: Cell) -> None:
        """All of it has moved east and north; what leaves the raster is lost."""
        height, width = len(self._first), self._width
        rows = np.flatnonzero(self._last >= 0)
        rows = rows[(rows + by.y >= 0) & (rows + by.y < height)]
        first, last = np.maximum(self._first[rows] + by.x, 0), np.minimum(self._last[rows] + by.x, width - 1)
        inside = first <= last
        self._first[:], self._last[:] = width, -1
        self._first[rows[inside] + by.y], self._last[rows[inside] + by.y] = first[inside], last[inside]


@njit(cache=True, nogil=True)
def _find(raster, first, last):  # type: ignore[no-untyped-def]
    height, width = raster.shape
    for y in range(height):
        x = 0
        while x < width and raster[y, x] == 0:
            x += 1
        if x == width:
            continue
        first[y] = x
        x = width - 1
        while raster[y, x] == 0:
            x -= 1
        last[y] = x
