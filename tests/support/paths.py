"""Whether a row of fields is a path."""

from __future__ import annotations

from collections.abc import Iterable

from companion.core.grid import Cell, Weights, as_array
from companion.planning.raster import first_fault, plain


def is_path(weights: Weights, cells: Iterable[Cell], corner_cutting: bool = False) -> bool:
    """Whether the fields are inside the map, free, each adjacent to the one before, and cut no corner."""
    return bool(first_fault(plain(weights), as_array(cells), corner_cutting)[0] == 0)
