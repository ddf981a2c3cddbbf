"""Which rows and columns of a raster may hold anything: never less than they do."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core.grid import Cell
from companion.mapping.seen_rows import SeenRows

SHAPE = (40, 24)
BOXES = st.lists(st.tuples(*(st.integers(-9, 49) for _ in range(4))), max_size=4)
BY = st.builds(Cell, st.integers(-50, 50), st.integers(-50, 50))


def covered(rows: SeenRows, step: int = 1) -> np.ndarray:
    """How often a window holds each cell."""
    found = np.zeros(SHAPE, np.int64)
    for window in rows.windows(step):
        for part, size in zip(window, SHAPE, strict=True):
            assert 0 <= part.start < part.stop <= size and part.start % step == part.stop % step == 0
        found[window] += 1
    return found


def filled(boxes: list[tuple[int, int, int, int]]) -> tuple[SeenRows, np.ndarray]:
    rows, cells = SeenRows(*SHAPE), np.zeros(SHAPE, np.bool_)
    for x0, y0, x1, y1 in boxes:
        rows.add(x0, y0, x1, y1)
        cells[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = True
    return rows, cells


@given(BOXES, st.sampled_from([1, 4, 8]))
def test_windows_hold_all_that_was_added_once(boxes: list[tuple[int, int, int, int]], step: int) -> None:
    rows, cells = filled(boxes)
    found = covered(rows, step)
    assert found.max() <= 1 and (found[cells] == 1).all()


@given(BOXES, BY)
def test_what_moves_is_held_where_it_is_then(boxes: list[tuple[int, int, int, int]], by: Cell) -> None:
    rows, cells = filled(boxes)
    moved = np.zeros(SHAPE, np.bool_)
    for y, x in np.argwhere(cells):
        if 0 <= y + by.y < SHAPE[0] and 0 <= x + by.x < SHAPE[1]:
            moved[y + by.y, x + by.x] = True
    rows.move(by)
    found = covered(rows)
    assert (found[moved] == 1).all() and (moved.any() or not found.any())


@given(arrays(np.float32, SHAPE, elements=st.sampled_from([0.0, -1.0, 2.0]), fill=st.just(0.0)))
def test_of_a_raster_it_is_the_first_and_the_last_of_each_row(raster: np.ndarray) -> None:
    rows = SeenRows.of(raster)
    for y in range(SHAPE[0]):
        columns = np.flatnonzero(raster[y])
        assert rows.span(y, y + 1) == ((columns[0], columns[-1] + 1) if len(columns) else (0, 0))
    assert rows.span(-5, 0) == rows.span(SHAPE[0], 99) == (0, 0)


def test_a_drive_aslant_holds_little_more_than_was_seen() -> None:
    rows = SeenRows(10_000, 10_000)
    for at in range(200, 9800, 10):
        rows.add(at - 120, at - 120, at + 120, at + 120)
    held = sum((y.stop - y.start) * (x.stop - x.start) for y, x in rows.windows())
    assert held < 1.4 * 9600 * 480
