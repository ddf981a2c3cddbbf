"""Even rays: a scan as viewers take it, a first bearing and a step. Many lidars turn unevenly, and one beside the
rover's middle sees near things in other directions than far ones.

Nouns: even rays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.core.scan import RangeScan

UNEVEN_SHARE = 0.25
"""Bearings count as even that are no farther than this share of a step from where they should be."""
NEAR_STEPS = 1.5
"""A ray tells what the reading nearest to it says, if that is no more than so many steps away."""


class EvenRays(NamedTuple):
    """Ray ``i`` looks to ``first_rad + i * step_rad``, clockwise from ahead. ``range_m``: shape (n,), as in a scan."""

    first_rad: float
    step_rad: float
    range_m: NDArray[np.float64]


def even_rays(scan: RangeScan, most: int | None = None) -> EvenRays:
    """A scan of at least one reading, with at most ``most`` rays."""
    bearings, ranges = np.unwrap(scan.bearing_rad), scan.range_m
    count = len(bearings)
    if count == 1:
        return EvenRays(float(bearings[0]), 0.0, ranges)
    every = math.ceil(count / (most or count))
    step_rad = float(bearings[-1] - bearings[0]) / (count - 1)
    ideal = bearings[0] + step_rad * np.arange(count)
    if np.abs(bearings - ideal).max() <= UNEVEN_SHARE * abs(step_rad):
        return EvenRays(float(bearings[0]), every * step_rad, ranges[::every])
    return _resampled(scan.bearing_rad, ranges, math.ceil(count / every))


def _resampled(bearing_rad: NDArray[np.float64], range_m: NDArray[np.float64], count: int) -> EvenRays:
    """Each ray as the reading nearest to it, from the end of the widest gap on round to its beginning."""
    order = np.argsort(bearing_rad % (2.0 * math.pi))
    turned, ranges = bearing_rad[order] % (2.0 * math.pi), range_m[order]
    gaps = np.diff(turned, append=turned[0] + 2.0 * math.pi)
    first = (int(gaps.argmax()) + 1) % len(turned)
    turned, ranges = np.roll(turned, -first), np.roll(ranges, -first)
    along = (turned - turned[0]) % (2.0 * math.pi)
    step_rad = float(along[-1]) / max(count - 1, 1)
    wanted = step_rad * np.arange(count)
    after = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1)
    nearest = np.where(wanted - along[after - 1] <= along[after] - wanted, after - 1, after)
    told = np.where(np.abs(along[nearest] - wanted) <= NEAR_STEPS * step_rad, ranges[nearest], np.nan)
    return EvenRays(float((turned[0] + math.pi) % (2.0 * math.pi) - math.pi), step_rad, told)
