"""Second-degree B-splines on clamped, equidistant knots (paper, section 3.1; Piegl & Tiller, A2.1 and A3.1). Compiled.

``n`` control points make ``n - 2`` knot spans of equal length; the curve begins in the first control point and ends in
the last. Only three basis functions differ from zero anywhere, so a basis is kept as three values and where they begin.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

DEGREE = 2
Points = NDArray[np.float64]


@njit(cache=True, nogil=True)
def knot(index: int, control_points: int) -> float:
    """Knot ``index`` of U = {0, 0, 0, 1, 2, ..., n-2, n-2, n-2}, in spans."""
    return float(min(max(index - DEGREE, 0), control_points - DEGREE))


@njit(cache=True, nogil=True)
def basis(control_points: int, samples: int) -> tuple[NDArray[np.int64], Points]:
    """Basis functions at ``samples`` places equally far apart in u, ends included.

    Returns, for each sample, the first control point that counts (shape (samples,)) and the weights of that
    one and the next two (shape (samples, 3)). Needs at least 3 control points and 2 samples.
    """
    first = np.empty(samples, np.int64)
    values = np.empty((samples, DEGREE + 1))
    spans = control_points - DEGREE
    for i in range(samples):
        u = spans * i / (samples - 1)
        span = min(int(u), spans - 1)
        left, low = knot(span + 1, control_points), knot(span + 2, control_points)
        high, right = knot(span + 3, control_points), knot(span + 4, control_points)
        rise = (u - low) / (high - low)
        before = (high - u) / (high - left)
        after = (u - low) / (right - low)
        first[i] = span
        values[i, 0] = before * (1.0 - rise)
        values[i, 2] = after * rise
        values[i, 1] = (1.0 - before) * (1.0 - rise) + (1.0 - after) * rise
    return first, values


@njit(cache=True, nogil=True)
def curve(control: Points, samples: int) -> Points:
    """The curve at ``samples`` places, shape (samples, 2), from control points of shape (n, 2), n >= 3."""
    first, values = basis(len(control), samples)
    points = np.empty((samples, 2))
    for i in range(samples):
        for axis in range(2):
            points[i, axis] = 0.0
            for j in range(DEGREE + 1):
                points[i, axis] += values[i, j] * control[first[i] + j, axis]
    return points
