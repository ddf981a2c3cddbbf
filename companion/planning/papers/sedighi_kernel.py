"""The path of a chromosome of Sedighi et al. 2004, and its length, turns and collisions. Compiled.

A chromosome has n genes. Gene k stands for a row (row-wise movement) or a column (column-wise), and its location for
the place in it: together vertex k of the path. Vertices are joined by a horizontal and a vertical line; the direction
of gene k says which of the two comes first on the way to vertex k + 1. ``modes`` has the flag (0: begins row-wise, 1:
column-wise) and two switch values: after gene s the movement is of the other kind; n - 1 is the paper's "no switch".
Genes count from 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights
from companion.planning.raster import CellArray

Numbers = NDArray[np.int64]
Counts = NDArray[np.int32]


class Square(NamedTuple):
    """The search space, n x n, laid over the map: the map's row and column for each gene and for each location.

    ``gene_rows``, ``gene_columns``: shape (n,), for each gene; the first and last vertex are always start and target
    (x, y). ``place_rows``, ``place_columns``: shape (side of the map,), for each location.
    """

    gene_rows: Numbers
    gene_columns: Numbers
    place_rows: Numbers
    place_columns: Numbers
    start: tuple[int, int]
    target: tuple[int, int]


class ObstacleCounts(NamedTuple):
    """Cumulative counts of obstacles, so that a line of any length takes two look-ups.

    ``across[y, x]``: obstacles in row y west of x, shape (height, width + 1). ``along[x, y]``: in column x south of y.
    """

    across: Counts
    along: Counts


class Chromosomes(NamedTuple):
    """A population, one chromosome a row: shapes (population, n), (population, n) and (population, 3)."""

    locations: Numbers
    directions: Numbers
    modes: Numbers


@njit(cache=True, nogil=True)
def spread(first: int, last: int, size: int, count: int) -> Numbers:
    """``count`` rows (or columns) from that of the start to that of the target, evenly.

    If there are fewer than ``count`` between them, the range is widened to both sides as far as the map (``size``)
    allows.
    """
    low, high = min(first, last), max(first, last)
    spare = max(min(count, size) - (high - low + 1), 0)
    low = min(max(low - spare // 2, 0), max(size - count, 0))
    low = min(low, first, last)
    high = max(high, min(low + count - 1, size - 1))
    lines = np.empty(count, np.int64)
    for k in range(count):
        share = math.floor((high - low) * k / max(count - 1, 1) + 0.5)
        lines[k] = high - share if first > last else low + share
    return lines


@njit(cache=True, nogil=True)
def square_over(width: int, height: int, start: tuple[int, int], target: tuple[int, int]) -> Square:
    """The paper's square search space for any map and any ends. From corner to corner of a square map it is the map."""
    genes = max(abs(target[0] - start[0]), abs(target[1] - start[1])) + 1
    side = max(width, height)
    places = np.arange(side)
    return Square(
        spread(start[1], target[1], height, genes),
        spread(start[0], target[0], width, genes),
        places * height // side,
        places * width // side,
        start,
        target,
    )


@njit(cache=True, nogil=True)
def summed(weights: Weights) -> ObstacleCounts:
    """See ``ObstacleCounts``."""
    height, width = weights.shape
    across = np.zeros((height, width + 1), np.int32)
    along = np.zeros((width, height + 1), np.int32)
    for y in range(height):
        for x in range(width):
            blocked = 1 if weights[y, x] >= OBSTACLE else 0
            across[y, x + 1] = across[y, x] + blocked
            along[x, y + 1] = along[x, y] + blocked
    return ObstacleCounts(across, along)


@njit(cache=True, nogil=True)
def between(sums: Counts, line: int, here: int, there: int) -> int:
    """Obstacles on a straight line along a row or column, without its first field."""
    if there > here:
        return int(sums[line, there + 1] - sums[line, here + 1])
    return int(sums[line, here] - sums[line, there])


@njit(cache=True, nogil=True)
def column_wise(modes: Numbers, i: int, k: int) -> bool:
    """Whether chromosome i moves column-wise to its vertex k: by its flag and the switches before k (C.1, C.4)."""
    flag, first, second = modes[i, 0], modes[i, 1], modes[i, 2]
    switches = (first < k) ^ ((second < k) & (second != first))  # two equal values are one switch
    return bool((flag == 1) ^ switches)


@njit(cache=True, nogil=True)
def measure(square: Square, ground: ObstacleCounts, population: Chromosomes, measures: Numbers) -> None:
    """Write every path's length in fields, its turns and its steps onto obstacles (section IV.A).

    All arrays are taken out of their tuples first: passing tuples to a function for each vertex takes most of the time.
    """
    locations, directions, modes = population
    gene_rows, gene_columns, place_rows, place_columns, start, target = square
    across, along = ground
    count, genes = locations.shape
    for i in range(count):
        length = turns = collisions = heading = 0
        x, y = start
        for k in range(1, genes):
            if k == genes - 1:
                to_x, to_y = target
            elif column_wise(modes, i, k):
                to_x, to_y = gene_columns[k], place_rows[locations[i, k]]
            else:
                to_x, to_y = place_columns[locations[i, k]], gene_rows[k]
            horizontal_first = directions[i, k - 1] == 1
            begin = end = 0
            if to_x != x:
                length += abs(to_x - x)
                collisions += between(across, y if horizontal_first else to_y, x, to_x)
                begin = end = 1 if to_x > x else -1
            if to_y != y:
                length += abs(to_y - y)
                collisions += between(along, to_x if horizontal_first else x, y, to_y)
                vertical = 2 if to_y > y else -2
                turns += begin != 0
                end = vertical if horizontal_first or begin == 0 else begin
                begin = begin if horizontal_first and begin != 0 else vertical
            if begin != 0:
                turns += (heading != 0) & (heading != begin)
                heading = end
            x, y = to_x, to_y
        measures[i, 0], measures[i, 1], measures[i, 2] = length, turns, collisions


@njit(cache=True, nogil=True)
def corners_of(square: Square, population: Chromosomes, i: int) -> CellArray:
    """The points between which path i is straight, shape (2 n - 1, 2); neighbours may be the same field."""
    locations = population.locations[i]
    genes = len(locations)
    corners = np.empty((2 * genes - 1, 2), np.int64)
    x, y = square.start
    corners[0, 0], corners[0, 1] = x, y
    for k in range(1, genes):
        if k == genes - 1:
            to_x, to_y = square.target
        elif column_wise(population.modes, i, k):
            to_x, to_y = square.gene_columns[k], square.place_rows[locations[k]]
        else:
            to_x, to_y = square.place_columns[locations[k]], square.gene_rows[k]
        horizontal_first = population.directions[i, k - 1] == 1
        corners[2 * k - 1, 0] = to_x if horizontal_first else x
        corners[2 * k - 1, 1] = y if horizontal_first else to_y
        x, y = to_x, to_y
        corners[2 * k, 0], corners[2 * k, 1] = x, y
    return corners
