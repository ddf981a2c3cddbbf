"""The way that the rover has come since the mission began, without its loops: the way back."""

from __future__ import annotations

import math
from itertools import pairwise

from companion.core.grid import Cell
from companion.navigation.field_step import fields_between


class Trail:
    """Fields from the first to the one the rover is in, each 8-adjacent to the one before, none of them twice."""

    def __init__(self) -> None:
        self._cells: list[Cell] = []
        self._places: dict[Cell, int] = {}

    def enter(self, cell: Cell) -> None:
        """The rover is in this field now. Entering a field anew cuts off all that came after it."""
        if self._cells and self._cells[-1] == cell:
            return
        if self._cells:
            for between in fields_between(self._cells[-1], cell):
                self._append(between)
        self._append(cell)

    def back(self) -> tuple[Cell, ...]:
        """From the field the rover is in to the first one."""
        return tuple(reversed(self._cells))

    @property
    def length_fields(self) -> float:
        """Length in fields; a diagonal step is sqrt 2."""
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(self._cells))

    def _append(self, cell: Cell) -> None:
        place = self._places.get(cell)
        if place is None:
            self._places[cell] = len(self._cells)
            self._cells.append(cell)
            return
        for gone in self._cells[place + 1 :]:
            del self._places[gone]
        del self._cells[place + 1 :]
