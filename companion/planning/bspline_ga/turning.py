"""Fitness of a B-spline chromosome for a vehicle that cannot turn on the spot. Compiled.

Kwasniewski & Gosiewski 2018 name this extension at their end. Within one knot span a B-spline of degree 2 is a
parabola, so its greatest curvature is known exactly: the cross product of its derivatives is constant, and the speed is
least where the derivative, which moves along a straight line, is nearest to zero.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Weights
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.parameters import Task
from companion.planning.raster import HALF, ONE, SHIFT, CellArray, fine_steps

SAMPLE_FIELDS = 1.0
"""The curve is followed by lines of about this length: they stay within much less than a field of it."""
MOST_EXCESS = 10.0
"""The excess of a turn is limited to this: so many times the curvature that the vehicle can drive."""


@njit(cache=True, nogil=True)
def control_of(genes: CellArray, task: Task) -> NDArray[np.float64]:
    """The control points, shape (n, 2): the chromosome with its second point moved onto the ray of the start heading.

    A B-spline starts towards its second control point, so the curve has the heading exactly. A point behind the vehicle
    is moved as far ahead of it.
    """
    control = genes.astype(np.float64)
    if not math.isnan(task.heading_rad):
        east, north = math.cos(task.heading_rad), math.sin(task.heading_rad)
        ahead = abs((control[1, 0] - control[0, 0]) * east + (control[1, 1] - control[0, 1]) * north)
        ahead = max(ahead, 1.0)
        control[1, 0], control[1, 1] = control[0, 0] + ahead * east, control[0, 1] + ahead * north
    return control


@njit(cache=True, nogil=True)
def derivatives(control: NDArray[np.float64], span: int) -> tuple[float, float, float, float]:
    """The curve's derivative by u at the two ends of a knot span: x, y and x, y."""
    last = len(control) - bspline.DEGREE - 1
    from_share, to_share = 2.0 if span == 0 else 1.0, 2.0 if span == last else 1.0
    return (
        from_share * (control[span + 1, 0] - control[span, 0]),
        from_share * (control[span + 1, 1] - control[span, 1]),
        to_share * (control[span + 2, 0] - control[span + 1, 0]),
        to_share * (control[span + 2, 1] - control[span + 1, 1]),
    )


@njit(cache=True, nogil=True)
def greatest_curvature_per_field(control: NDArray[np.float64], span: int) -> float:
    """The greatest curvature in a knot span; infinite where the curve stops."""
    from_x, from_y, to_x, to_y = derivatives(control, span)
    change_x, change_y = to_x - from_x, to_y - from_y
    length2 = change_x * change_x + change_y * change_y
    share = 0.0
    if length2 > 0.0:
        share = min(max(-(from_x * change_x + from_y * change_y) / length2, 0.0), 1.0)
    slowest = math.hypot(from_x + share * change_x, from_y + share * change_y)
    if slowest < 1e-6:
        return math.inf
    return abs(from_x * to_y - from_y * to_x) / slowest**3


@njit(cache=True, nogil=True)
def curvature_excess(control: NDArray[np.float64], radius_fields: float) -> float:
    """0 if no turn is tighter than the radius; else the sum over the spans that are, each at least 1."""
    total = 0.0
    for span in range(len(control) - bspline.DEGREE):
        turn = greatest_curvature_per_field(control, span) * radius_fields
        if turn > 1.0:
            total += min(turn, MOST_EXCESS)
    return total


@njit(cache=True, nogil=True)
def curve_samples(control: NDArray[np.float64]) -> int:
    """Samples in each knot span so that the lines between them are at most SAMPLE_FIELDS long."""
    fastest = 0.0
    for span in range(len(control) - bspline.DEGREE):
        from_x, from_y, to_x, to_y = derivatives(control, span)
        fastest = max(fastest, math.hypot(from_x, from_y), math.hypot(to_x, to_y))
    return int(fastest / SAMPLE_FIELDS) + 1


@njit(cache=True, nogil=True)
def curve_points(control: NDArray[np.float64]) -> CellArray:
    """The fields of the samples along the curve, start and target included."""
    samples = curve_samples(control) * (len(control) - bspline.DEGREE) + 1
    smooth = bspline.curve(control, samples)
    points = np.empty((samples, 2), np.int64)
    for i in range(samples):
        for axis in range(2):
            points[i, axis] = math.floor(smooth[i, axis] + 0.5)
    return points


@njit(cache=True, nogil=True)
def turning_fitness(weights: Weights, genes: CellArray, task: Task, vln: float, limit: float) -> float:
    """Equation 5 along the curve itself, plus ``vln`` times the ``curvature_excess``.

    Stops as soon as it has reached ``limit``.
    """
    control = control_of(genes, task)
    total: float = vln * curvature_excess(control, task.turning_radius_fields)
    if total >= limit:
        return total
    points = curve_points(control)
    total -= weights[task.target_y, task.target_x]
    for i in range(1, len(points)):
        total += _line_value(weights, points[i - 1], points[i], task.corner_cutting, vln)
        if total >= limit:
            return total
    return total


@njit(cache=True, nogil=True)
def _line_value(weights: Weights, start: CellArray, end: CellArray, corner_cutting: bool, vln: float) -> float:
    """What the fields under a line cost, without its first field; see ``fitness.fitness``."""
    height, width = weights.shape
    x, y = start[0], start[1]
    steps, step_x, step_y = fine_steps(end[0] - x, end[1] - y)
    fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
    total = 0.0
    for _ in range(steps):
        from_x, from_y = x, y
        fine_x += step_x
        fine_y += step_y
        x, y = fine_x >> SHIFT, fine_y >> SHIFT
        if not (0 <= x < width and 0 <= y < height) or weights[y, x] >= OBSTACLE:
            total += vln
            continue
        total += weights[y, x]
        if corner_cutting or x == from_x or y == from_y:
            continue
        if 0 <= from_x < width and 0 <= from_y < height and max(weights[from_y, x], weights[y, from_x]) >= OBSTACLE:
            total += vln
    return total
