"""Chromosomes of different lengths: the number of control points is one more gene (our extension). Compiled.

Kwasniewski & Gosiewski 2018 call the choice of this number an important problem that they solve in a basic way. Here
equation 6 crosses the number as it crosses coordinates. It mutates by knot insertion and removal (Piegl & Tiller,
A5.1), which hardly change the curve, so that a new control point begins where it does no harm.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.operators import Chromosomes, choose_parents
from companion.planning.bspline_ga.parameters import Tuning
from companion.planning.random_numbers import State, uniform, whole
from companion.planning.raster import CellArray

LEAST = bspline.DEGREE + 1


@njit(cache=True, nogil=True)
def abscissa(i: int, control_points: int) -> float:
    """Where along the curve control point ``i`` has most influence (its Greville abscissa), 0 to 1."""
    spans = control_points - bspline.DEGREE
    return min(max(i - 0.5, 0.0), float(spans)) / spans


@njit(cache=True, nogil=True)
def between(genes: CellArray, control_points: int, place: float, axis: int) -> float:
    """The control polygon's coordinate at a place from 0 to 1, interpolated between abscissae."""
    at = place * (control_points - bspline.DEGREE) + 0.5
    i = min(max(int(at), 0), control_points - 2)
    low, high = abscissa(i, control_points), abscissa(i + 1, control_points)
    share = (place - low) / (high - low)
    return float(genes[i, axis] * (1.0 - share) + genes[i + 1, axis] * share)


@njit(cache=True, nogil=True)
def insert_knot(genes: CellArray, control_points: int, span: int) -> None:
    """One control point more: a knot in the middle of a span. ``genes`` has room for it.

    Afterwards knots count as equidistant again.
    """
    at = span + 1
    before, after = _shares(span, control_points)
    for i in range(control_points, at + 1, -1):
        genes[i, 0], genes[i, 1] = genes[i - 1, 0], genes[i - 1, 1]
    for axis in range(2):
        previous, middle, following = genes[at - 1, axis], genes[at, axis], genes[at + 2, axis]
        genes[at, axis] = math.floor(before * previous + (1.0 - before) * middle + 0.5)
        genes[at + 1, axis] = math.floor(after * following + (1.0 - after) * middle + 0.5)


@njit(cache=True, nogil=True)
def remove_knot(genes: CellArray, control_points: int, span: int) -> None:
    """One control point less: reverses ``insert_knot`` in this span of the shorter curve, as far as possible."""
    at = span + 1
    before, after = _shares(span, control_points - 1)
    for axis in range(2):
        left = (genes[at, axis] - before * genes[at - 1, axis]) / (1.0 - before)
        right = (genes[at + 1, axis] - after * genes[at + 2, axis]) / (1.0 - after)
        genes[at, axis] = math.floor(0.5 * (left + right) + 0.5)
    for i in range(at + 1, control_points - 1):
        genes[i, 0], genes[i, 1] = genes[i + 1, 0], genes[i + 1, 1]


@njit(cache=True, nogil=True)
def _shares(span: int, control_points: int) -> tuple[float, float]:
    """How much of its two neighbours goes into the two points that the control point of a span is split into."""
    last = control_points - bspline.DEGREE - 1
    return 0.5 if span == 0 else 0.25, 0.5 if span == last else 0.25


@njit(cache=True, nogil=True)
def breed_any(
    genes: CellArray,
    parents: Chromosomes,
    counts: NDArray[np.int64],
    mutation_fields: int,
    tuning: Tuning,
    state: State,
) -> int:
    """``operators.breed`` for parents of different lengths. Returns the child's number of control points.

    On average as many inner coordinates mutate as in a chromosome of four control points. If each coordinate of a
    longer one kept the same probability, hardly any child would resemble its parents.
    """
    better, other = choose_parents(len(parents), state)
    count: int = math.floor(tuning.mixing * counts[better] + (1.0 - tuning.mixing) * counts[other] + 0.5)
    genes[0, 0], genes[0, 1] = parents[better, 0, 0], parents[better, 0, 1]
    for i in range(1, count):
        place = abscissa(i, count)
        for axis in range(2):
            mixed = tuning.mixing * between(parents[better], counts[better], place, axis)
            mixed += (1.0 - tuning.mixing) * between(parents[other], counts[other], place, axis)
            genes[i, axis] = math.floor(mixed + 0.5)
    if uniform(state) < tuning.number_probability:
        if uniform(state) < 0.5:
            if count < tuning.most_control_points:
                insert_knot(genes, count, whole(state, 0, count - bspline.DEGREE - 1))
                count += 1
        elif count > LEAST:
            remove_knot(genes, count, whole(state, 0, count - bspline.DEGREE - 2))
            count -= 1
    probability = tuning.mutation_probability * min(1.0, 2.0 / (count - 2))
    for i in range(1, count - 1):
        for axis in range(2):
            if uniform(state) < probability:
                genes[i, axis] += whole(state, -mutation_fields, mutation_fields)
    return count
