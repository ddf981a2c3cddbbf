"""Distance field: how far each cell of a raster is from the nearest marked one, exactly.

Two passes of parabolas' lower envelopes (Felzenszwalb & Huttenlocher 2012, "Distance transforms of sampled functions").

Nouns: distance field.
"""

# mypy: disable-error-code="no-untyped-def"

import math

import numpy as np
from numba import njit

FAR = 1e6
"""The distance where nothing is marked, in cells."""


@njit(cache=True, nogil=True)
def distance_field(marked):
    """Distances between middles of cells, in cells, shape as ``marked``; ``FAR`` where nothing is marked."""
    height, width = marked.shape
    squares = np.empty((height, width), np.float64)
    # Along columns two sweeps do: each cell's distance to the nearest marked one of its column. Row by row, as the
    # cells lie in memory.
    gaps = np.full(width, FAR)
    for y in range(height):
        for x in range(width):
            gaps[x] = 0.0 if marked[y, x] else gaps[x] + 1.0
            squares[y, x] = gaps[x]
    gaps[:] = FAR
    for y in range(height - 1, -1, -1):
        for x in range(width):
            gaps[x] = 0.0 if marked[y, x] else gaps[x] + 1.0
            nearest = min(squares[y, x], gaps[x])
            squares[y, x] = nearest * nearest
    distances = np.empty((height, width), np.float32)
    tops = np.empty(width, np.int64)
    bounds = np.empty(width + 1, np.float64)
    for y in range(height):
        row = squares[y]
        last = -1
        for x in range(width):
            if row[x] >= FAR * FAR:
                continue  # nothing is marked in this column
            at = -np.inf
            while last >= 0:
                at = _crossing(row, tops[last], x)
                if at > bounds[last]:
                    break
                last -= 1
                at = -np.inf
            last += 1
            tops[last], bounds[last], bounds[last + 1] = x, at, np.inf
        if last < 0:
            distances[y] = FAR
            continue
        first = 0
        for piece in range(last + 1):
            end = min(int(math.floor(min(bounds[piece + 1], width))) + 1, width)
            top, square = float(tops[piece]), row[tops[piece]]
            for x in range(first, end):
                distances[y, x] = min(math.sqrt((x - top) * (x - top) + square), FAR)
            first = max(first, end)
    return distances


@njit(cache=True, nogil=True)
def _crossing(row, left, right):
    """Where the parabolas over two places of a row cross."""
    return ((row[right] + right * right) - (row[left] + left * left)) / (2.0 * (right - left))
