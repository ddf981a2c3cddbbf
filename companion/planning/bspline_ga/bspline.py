"""B-spline curves of degree 2 on clamped, equidistant knots (paper, section 3.1; Piegl & Tiller, A2.1 and A3.1).

Compiled.

``n`` control points make ``n - 2`` knot spans of equal length. The curve begins in the first control point and ends in
the last. At any place only three basis functions differ from zero, so a basis is stored as three values and an index.

Nouns: B-spline.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

DEGREE = 2
Points = NDArray[np.float64]


class Basis(NamedTuple):
    """Basis functions at some places of a curve.

    ``first``: the first control point that counts at each place, shape (samples,). ``values``: the weights of that one
    and the next two, shape (samples, 3).
    """

    first: NDArray[np.int64]
    values: Points


@njit(cache=True, nogil=True, inline="always")
def basis_at(spans: int, u: float) -> tuple[int, float, float, float]:
    """The basis ``u`` knot spans from the start: the first control point that counts, and three weights."""
    span = min(int(u), spans - 1)
    rise = u - span
    # With equidistant knots the recursion reduces to squares: halved where the function's support extends into
    # the next span, not halved at the clamped ends. The three weights always sum to 1.
    falling = (1.0 - rise) * (1.0 - rise) * (1.0 if span == 0 else 0.5)
    rising = rise * rise * (1.0 if span == spans - 1 else 0.5)
    return span, falling, 1.0 - falling - rising, rising


@njit(cache=True, nogil=True)
def basis(control_points: int, samples: int) -> Basis:
    """Basis functions at ``samples`` places equally far apart in u, ends included.

    Needs at least 3 control points and 2 samples.
    """
    first = np.empty(samples, np.int64)
    values = np.empty((samples, DEGREE + 1))
    spans = control_points - DEGREE
    share = spans / (samples - 1.0)
    for i in range(samples):
        first[i], values[i, 0], values[i, 1], values[i, 2] = basis_at(spans, i * share)
    return Basis(first, values)


@njit(cache=True, nogil=True)
def curve(control: Points, samples: int) -> Points:
    """The curve at ``samples`` places, shape (samples, 2), from control points of shape (n, 2), n >= 3."""
    points = np.empty((samples, 2))
    spans = len(control) - DEGREE
    share = spans / max(samples - 1.0, 1.0)
    i = 0
    for span in range(spans):
        # In one span the curve is a parabola in ``rise``: here its value at 0, its slope there and its curvature.
        _, a, b, _ = basis_at(spans, float(span))
        opening = 2.0 if span == 0 else 1.0
        closing = 1.0 if span == spans - 1 else 0.5
        while i < samples and (span == spans - 1 or i * share < span + 1):
            rise = i * share - span
            for axis in range(2):
                p, q, r = control[span, axis], control[span + 1, axis], control[span + 2, axis]
                points[i, axis] = (
                    a * p + b * q + rise * (opening * (q - p) + rise * (closing * (r - q) - 0.5 * opening * (q - p)))
                )
            i += 1
    return points
