"""What a chromosome of Kwasniewski & Gosiewski 2018 is worth (section 3.4). Compiled.

A chromosome has shape (control points, 2): columns x and y in whole fields; its ends are start and target.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights
from companion.planning.bspline_ga import bspline
from companion.planning.raster import HALF, ONE, SHIFT, CellArray, fine_steps

U = np.uint64
PER_ONE = 1.0 / ONE

GLANCES = 16
GLANCE_FIELDS = 64
"""Before all fields are summed a few are looked at, so many on a line as long as the map, but one in so many fields at least."""


class Tuning(NamedTuple):
    """The settings of the algorithm as the kernel wants them; see ``PlannerSettings``."""

    way_points: int
    span_way_points: int
    mixing: float
    selected_share: float
    mutation_probability: float
    mutation_range: float
    line_probability: float
    line_range: float
    neighbourhood: float
    margin_fields: int
    obstacle_value: float
    adaptive: bool = False
    most_control_points: int = 16
    number_probability: float = 0.5


class Task(NamedTuple):
    """Start, target, the rule for corners; how tightly the vehicle turns (0: on the spot) and its heading (NaN: any).

    ``by_length``: fields count as much as the line under them is long, not all alike.
    """

    start_x: int
    start_y: int
    target_x: int
    target_y: int
    corner_cutting: bool
    turning_radius: float = 0.0
    heading: float = math.nan
    by_length: bool = False


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
    """Whether this is the fitness of a path without an obstacle; half a field is left for rounding."""
    return value < vln - 0.5


@njit(cache=True, nogil=True)
def way_point(genes: CellArray, first: NDArray[np.int64], basis: NDArray[np.float64], i: int) -> tuple[int, int]:
    """Way point ``i`` of a chromosome, rounded to the nearest field centre (3.4)."""
    at = first[i]
    x = basis[i, 0] * genes[at, 0] + basis[i, 1] * genes[at + 1, 0] + basis[i, 2] * genes[at + 2, 0]
    y = basis[i, 0] * genes[at, 1] + basis[i, 1] * genes[at + 1, 1] + basis[i, 2] * genes[at + 2, 1]
    return math.floor(x + 0.5), math.floor(y + 0.5)


@njit(cache=True, nogil=True)
def glance(
    weights: Weights, genes: CellArray, first: NDArray[np.int64], basis: NDArray[np.float64], enough: float
) -> float:
    """Obstacles among a few fields of every long line, up to ``enough``: there are at least so many under the whole path.

    Most chromosomes are hopeless, and on a large map every field is a wait for memory.
    """
    height, width = weights.shape
    stride = min(max(width, height) // GLANCES + 1, GLANCE_FIELDS)
    seen = 0.0
    x, y = genes[0, 0], genes[0, 1]
    for i in range(1, len(first)):
        to_x, to_y = way_point(genes, first, basis, i)
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
def fitness(
    weights: Weights,
    genes: CellArray,
    first: NDArray[np.int64],
    basis: NDArray[np.float64],
    corner_cutting: bool,
    vln: float,
    limit: float,
    by_length: bool = False,
) -> float:
    """Equation 5: the sum of the fields under the lines from way point to way point, start and target counting 0.

    Obstacles and fields outside the map count ``vln`` each, a cut corner adds ``vln``; a line that leaves the map is
    not looked at for corners. ``by_length``: the fields of a line count by its length, so that of two ways over as many
    fields the straighter is the fitter (ours). See ``is_correct``. Stops early once it has reached ``limit``. The lines are those of
    ``raster.line_into``, drawn here once more: a call for each would take longer than the line.
    """
    height, width = weights.shape
    total: float = -weights[genes[-1, 1], genes[-1, 0]]
    x, y = genes[0, 0], genes[0, 1]
    inside = True
    for i in range(1, len(first)):
        to_x, to_y = way_point(genes, first, basis, i)
        steps, step_x, step_y = fine_steps(to_x - x, to_y - y)
        fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
        was_inside, inside = inside, 0 <= to_x < width and 0 <= to_y < height
        safe = was_inside and inside
        strict = safe and not corner_cutting
        before = total
        for _ in range(steps):
            from_x, from_y = x, y
            fine_x += step_x
            fine_y += step_y
            x, y = fine_x >> SHIFT, fine_y >> SHIFT
            value = vln
            if safe or (0 <= x < width and 0 <= y < height):
                value = weights[U(y), U(x)]  # unsigned: else the compiler looks for negative indices
                worst = value
                if strict:  # looking beside every field is quicker than a branch that nobody can predict
                    beside = max(weights[U(from_y), U(x)], weights[U(y), U(from_x)])
                    worst = max(value, beside if (x != from_x) & (y != from_y) else 0.0)
                if worst >= OBSTACLE:
                    value = vln if value >= OBSTACLE else vln + value
                    if total + value >= limit:
                        return total + value
            total += value
        if by_length and steps > 0:
            total = before + (total - before) * math.hypot(step_x, step_y) * PER_ONE
        x, y = to_x, to_y
        if total >= limit:
            return total
    return total
