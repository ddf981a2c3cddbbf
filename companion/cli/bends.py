"""How sharply a line bends, and where a rover with a turning radius could not follow it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Line = NDArray[np.float64]

TOLERANCE = 0.95
"""A line is sampled, so its radius is only exact to some per cent."""


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
