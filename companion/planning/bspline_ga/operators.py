"""Initial population, crossover and mutation (Kwasniewski & Gosiewski 2018, sections 3.3, 3.6 and 3.7). Compiled.

Nouns: crossover, mutation.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.bspline_ga.parameters import Tuning
from companion.planning.random_numbers import State, uniform, whole
from companion.planning.raster import CellArray

Chromosomes = NDArray[np.int64]


@njit(cache=True, nogil=True)
def scatter(genes: CellArray, group: int, width: int, height: int, tuning: Tuning, state: State) -> None:
    """Fill in the inner points of a chromosome of the initial population (3.3).

    Group 0: near the straight line, 1: near the start, 2: anywhere. The ends of the chromosome are set already.
    """
    last = len(genes) - 1
    start_x, start_y, target_x, target_y = genes[0, 0], genes[0, 1], genes[last, 0], genes[last, 1]
    smaller = min(width, height)
    shift, reach = math.ceil(tuning.line_range * smaller), math.ceil(tuning.neighbourhood * smaller)
    margin_x, margin_y = min(tuning.margin_fields, (width - 1) // 2), min(tuning.margin_fields, (height - 1) // 2)
    for i in range(1, last):
        if group == 0:
            genes[i, 0] = start_x + math.floor((target_x - start_x) * i / last + 0.5)
            genes[i, 1] = start_y + math.floor((target_y - start_y) * i / last + 0.5)
            for axis in range(2):
                if uniform(state) < tuning.line_probability:
                    genes[i, axis] += whole(state, -shift, shift)
        elif group == 1:
            genes[i, 0] = whole(state, max(start_x - reach, 0), min(start_x + reach, width - 1))
            genes[i, 1] = whole(state, max(start_y - reach, 0), min(start_y + reach, height - 1))
        else:
            genes[i, 0] = whole(state, margin_x, width - 1 - margin_x)
            genes[i, 1] = whole(state, margin_y, height - 1 - margin_y)


@njit(cache=True, nogil=True)
def choose_parents(count: int, state: State) -> tuple[int, int]:
    """Two different ranks below ``count`` at random, the better one first."""
    a = whole(state, 0, count - 1)
    b = whole(state, 0, count - 2)
    if b >= a:
        b += 1
    return min(a, b), max(a, b)


@njit(cache=True, nogil=True)
def breed(genes: CellArray, parents: Chromosomes, mutation_fields: int, tuning: Tuning, state: State) -> None:
    """A new chromosome: equation 6 on two different parents, then mutation (3.7). Parents are in order of fitness.

    The second case of equation 6 is read as D * CB + (1 - D) * CA: the better parent always gets the larger share.
    """
    better, other = choose_parents(len(parents), state)
    for i in range(1, len(genes) - 1):
        for axis in range(2):
            mixed = tuning.mixing * parents[better, i, axis] + (1.0 - tuning.mixing) * parents[other, i, axis]
            genes[i, axis] = math.floor(mixed + 0.5)
            if uniform(state) < tuning.mutation_probability:
                genes[i, axis] += whole(state, -mutation_fields, mutation_fields)
