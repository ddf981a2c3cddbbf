"""Fitness of a B-spline chromosome (Kwasniewski & Gosiewski 2018, section 3.4). Compiled.

A chromosome has shape (control points, 2), columns x and y in whole fields. Its first and last row are start and
target.

Nouns: fitness.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from companion.core.grid import OBSTACLE, Weights
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.bspline import Basis
from companion.planning.bspline_ga.parameters import Task, Tuning
from companion.planning.raster import HALF, ONE, SHIFT, CellArray, fine_steps

U = np.uint64
PER_ONE = 1.0 / ONE

GLANCES = 16
GLANCE_FIELDS = 64
"""A few fields are checked before all are summed: GLANCES on a line as long as the map, at least 1 in GLANCE_FIELDS."""


@njit(cache=True, nogil=True)
def way_points_for(control_points: int, tuning: Tuning) -> int:
    """How many points of the curve are joined by straight lines (3.4)."""
    return max(tuning.way_points, tuning.span_way_points * (control_points - bspline.DEGREE) + 1)


@njit(cache=True, nogil=True)
def large_value(control_points: int, width: int, height: int, tuning: Tuning) -> float:
    """VLN (3.4): the setting, or more on a map so large that a correct path could cost as much."""
    return max(tuning.obstacle_value, float(way_points_for(control_points, tuning) * max(width, height)))


@njit(cache=True, nogil=True)
def is_correct(value: float, vln: float) -> bool:
    """Whether this is the fitness of a path without an obstacle. Half a field is left for rounding errors."""
    return value < vln - 0.5


@njit(cache=True, nogil=True)
def way_point(genes: CellArray, basis: Basis, i: int) -> tuple[int, int]:
    """Way point ``i`` of a chromosome, rounded to the nearest field centre (3.4)."""
    at, values = basis.first[i], basis.values
    x = values[i, 0] * genes[at, 0] + values[i, 1] * genes[at + 1, 0] + values[i, 2] * genes[at + 2, 0]
    y = values[i, 0] * genes[at, 1] + values[i, 1] * genes[at + 1, 1] + values[i, 2] * genes[at + 2, 1]
    return math.floor(x + 0.5), math.floor(y + 0.5)


@njit(cache=True, nogil=True)
def glance(weights: Weights, genes: CellArray, basis: Basis, enough: float) -> float:
    """Obstacles among a few fields of every long line, up to ``enough``: a lower bound for those under the whole path.

    Most chromosomes are hopeless, and on a large map every field costs a memory access.
    """
    height, width = weights.shape
    stride = min(max(width, height) // GLANCES + 1, GLANCE_FIELDS)
    seen = 0.0
    x, y = genes[0, 0], genes[0, 1]
    for i in range(1, len(basis.first)):
        to_x, to_y = way_point(genes, basis, i)
        steps, step_x, step_y = fine_steps(to_x - x, to_y - y)
        at_x, at_y, done = to_x, to_y, 0
        while done < steps:
            if not (0 <= at_x < width and 0 <= at_y < height) or weights[U(at_y), U(at_x)] >= OBSTACLE:
                seen += 1.0
                if seen >= enough:
                    return seen
            done += stride
            at_x, at_y = (x * ONE + HALF + done * step_x) >> SHIFT, (y * ONE + HALF + done * step_y) >> SHIFT
        x, y = to_x, to_y
    return seen


@njit(cache=True, nogil=True)
def fitness(weights: Weights, genes: CellArray, basis: Basis, task: Task, vln: float, limit: float) -> float:
    """Equation 5: the sum of the fields under the lines from way point to way point; start and target count 0.

    Obstacles and fields outside the map count ``vln`` each, and a cut corner adds ``vln``. A line that leaves the map
    is not checked for corners. With ``task.by_length`` the fields of a line count in proportion to its length, so that
    of two paths over equally many fields the straighter one is fitter (ours). See ``is_correct``.

    Stops as soon as it has reached ``limit``. The lines are those of ``raster.line_into``, drawn here again because a
    call for each line would take longer than the line.
    """
    height, width = weights.shape
    total: float = -weights[genes[-1, 1], genes[-1, 0]]
    x, y = genes[0, 0], genes[0, 1]
    inside = True
    for i in range(1, len(basis.first)):
        to_x, to_y = way_point(genes, basis, i)
        steps, step_x, step_y = fine_steps(to_x - x, to_y - y)
        fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
        was_inside, inside = inside, 0 <= to_x < width and 0 <= to_y < height
        safe = was_inside and inside
        strict = safe and not task.corner_cutting
        before = total
        for _ in range(steps):
            from_x, from_y = x, y
            fine_x += step_x
            fine_y += step_y
            x, y = fine_x >> SHIFT, fine_y >> SHIFT
            value = vln
            if safe or (0 <= x < width and 0 <= y < height):
                value = weights[U(y), U(x)]  # unsigned: else the compiler adds a test for negative indices
                worst = value
                if strict:  # checking both neighbours of every field is faster than a branch that cannot be predicted
                    beside = max(weights[U(from_y), U(x)], weights[U(y), U(from_x)])
                    worst = max(value, beside if (x != from_x) & (y != from_y) else 0.0)
                if worst >= OBSTACLE:
                    value = vln if value >= OBSTACLE else vln + value
                    if total + value >= limit:
                        return total + value
            total += value
        if task.by_length and steps > 0:
            total = before + (total - before) * math.hypot(step_x, step_y) * PER_ONE
        x, y = to_x, to_y
        if total >= limit:
            return total
    return total
