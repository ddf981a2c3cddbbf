"""Compiled loops over the cells of a map tile.

Nouns: tile kernel.
"""

# mypy: disable-error-code="no-untyped-def"

from numba import njit

from companion.core.grid import BASE_WEIGHT, OBSTACLE

UNKNOWN, FREE, SEEN_OBSTACLE, CLOSED, COSTLY = range(5)
"""What a cell is. ``CLOSED``: by a fence, the mission or a known map; ``COSTLY``: ground that the mission calls so."""
MOST_RUN = 32
"""A run's length takes five bits of its byte, what it is made of the other three."""


@njit(cache=True, nogil=True)
def classify(log_odds, weights, subdivisions, occupied_at, x0, y0, classes):
    """Write what the evidence cells from (x0, y0) on are into ``classes``, shape (rows, columns).

    What is seen counts more than what the mission says. Beyond the map nothing is written. Returns whether any cell is
    known.
    """
    known = False
    rows, columns = min(classes.shape[0], log_odds.shape[0] - y0), min(classes.shape[1], log_odds.shape[1] - x0)
    for row in range(rows):
        field_y, field_x = (y0 + row) // subdivisions, x0 // subdivisions
        left = subdivisions - x0 % subdivisions  # cells of this field: no division for each cell
        for column in range(columns):
            found, weight = log_odds[y0 + row, x0 + column], weights[field_y, field_x]
            left -= 1
            if left == 0:
                field_x, left = field_x + 1, subdivisions
            kind = FREE if found < 0.0 else UNKNOWN
            if found >= occupied_at:
                kind = SEEN_OBSTACLE
            elif weight >= OBSTACLE:
                kind = CLOSED
            elif weight > BASE_WEIGHT:
                kind = COSTLY
            classes[row, column] = kind
            known |= kind != UNKNOWN
    return known


@njit(cache=True, nogil=True)
def write_runs(cells, runs):
    """Write ``cells``, shape (n,), as runs into ``runs``, which has room for n; returns how many bytes they take."""
    count, at = 0, 0
    while at < cells.size:
        end = at + 1
        while end < cells.size and end - at < MOST_RUN and cells[end] == cells[at]:
            end += 1
        runs[count] = cells[at] << 5 | (end - at - 1)
        count, at = count + 1, end
    return count
