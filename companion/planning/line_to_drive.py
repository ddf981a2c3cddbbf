"""The line to drive along a path: where it sets out, how sharply it bends, and where a rover could not follow it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.planning.problem import Path

Line = NDArray[np.float64]

AHEAD_DEG = 10.0
"""A line that starts this near to the rover's heading can be driven: its first step is a chord of an arc."""

TOLERANCE = 0.95
"""A line is sampled, so its radius is only exact to some per cent."""


def line_of(path: Path) -> Line:
    """The path's curve, or else the line through the middles of its fields.

    Shape (n, 2), in fields.
    """
    return path.cell_array.astype(np.float64) if path.curve is None else path.curve


def bearing_of(line: Line) -> float:
    """The direction in which a line starts: 0 along +x, growing towards +y."""
    x, y = next(step for step in line - line[0] if step.any())
    return math.atan2(y, x)


def tightest_radius(line: Line) -> float:
    """The radius of a line's sharpest bend, in the line's own unit; inf if it is straight."""
    _, radii = _bends(line)
    return float(radii.min()) if len(radii) else np.inf


def too_tight(line: Line, radius: float) -> Line:
    """The places where a line bends more sharply than this radius, the sharpest of each bend; shape (n, 2)."""
    places, radii = _bends(line)
    tight = np.flatnonzero(radii < TOLERANCE * radius)
    apart = np.flatnonzero(np.diff(tight) > 1) + 1
    bends = [bend for bend in np.split(tight, apart) if len(bend)]
    return places[[bend[np.argmin(radii[bend])] for bend in bends]] if bends else np.empty((0, 2))


def _bends(line: Line) -> tuple[Line, NDArray[np.float64]]:
    """The inner points of a line and the radii there: mean of the two steps there / change of direction."""
    line = line[np.concatenate(([True], np.diff(line, axis=0).any(axis=1)))]
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    turns[turns <= 1e-9] = np.nan
    radii = 0.5 * (lengths[1:] + lengths[:-1]) / turns
    return line[1:-1], np.where(np.isnan(radii), np.inf, radii)
