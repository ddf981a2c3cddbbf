"""Scans for viewers, which know a first bearing and a step only."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.scan import RangeScan
from companion.viewer.even_rays import NEAR_STEPS, even_rays
from companion.viewer.foxglove import laser_scan


def scan_of(bearing_rad: np.ndarray, range_m: np.ndarray) -> RangeScan:
    return RangeScan(0.0, bearing_rad, range_m, 0.1, 12.0, 0.01, "lidar")


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@pytest.mark.parametrize("begin_rad", [-math.pi, 0.0, 2.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_even_bearings_are_told_as_they_are(begin_rad: float, sign: float) -> None:
    ranges = np.arange(1.0, 11.0)
    first_rad, step_rad, told = even_rays(scan_of(wrapped(begin_rad + sign * 0.5 * np.arange(10)), ranges))
    assert first_rad == pytest.approx(float(wrapped(np.array(begin_rad)))) and step_rad == pytest.approx(sign * 0.5)
    assert np.array_equal(told, ranges)
    assert np.array_equal(
        even_rays(scan_of(wrapped(begin_rad + sign * 0.5 * np.arange(10)), ranges), 5)[2], ranges[::2]
    )


@given(st.integers(0, 2**32), st.floats(0.5, 2.0 * math.pi), st.integers(3, 400), st.integers(2, 180))
def test_what_is_told_was_read_in_about_that_direction(seed: int, span_rad: float, count: int, most: int) -> None:
    """Whatever order the readings have and however uneven they are. The range stands for the bearing."""
    rng = np.random.default_rng(seed)
    bearings = wrapped(rng.uniform(-math.pi, math.pi) + rng.uniform(0.0, span_rad, count))
    told = even_rays(scan_of(bearings, bearings + 4.0), most)
    assert 1 <= len(told.range_m) <= max(most, 1)
    looks = wrapped(told.first_rad + told.step_rad * np.arange(len(told.range_m)))
    off_rad = np.abs(wrapped(told.range_m - 4.0 - looks))
    assert np.nanmax(off_rad, initial=0.0) <= NEAR_STEPS * abs(told.step_rad) + 1e-6


def test_a_lidar_beside_the_middle_is_told_where_it_sees() -> None:
    """A wall to the north of a lidar that stands 0.3 m ahead of the middle: all that is told lies on the wall."""
    angles = np.radians(np.arange(-80.0, 81.0, 0.8))
    north, east = 0.3 + 2.0 * np.ones_like(angles), 2.0 * np.tan(angles)
    scan = scan_of(np.arctan2(east, north), np.hypot(north, east))
    told = even_rays(scan, 180)
    looks = told.first_rad + told.step_rad * np.arange(len(told.range_m))
    near = told.range_m < 6.0
    assert np.count_nonzero(near) > 80 and np.abs(told.range_m * np.cos(looks) - 2.3)[near].max() < 0.15
    message = laser_scan(0, scan)
    ends = np.linspace(message["start_angle"], message["end_angle"], len(message["ranges"]))
    ahead = np.array(message["ranges"]) * np.cos(ends)
    assert np.abs(ahead - 2.3)[(np.array(message["ranges"]) > 0.0) & (np.array(message["ranges"]) < 6.0)].max() < 0.15


def test_where_nothing_looks_nothing_is_told() -> None:
    bearings = np.concatenate((np.radians(np.arange(-90.0, -40.0)), np.radians(np.arange(40.0, 90.0))))
    told = even_rays(scan_of(bearings, np.full(100, 3.0)))
    looks = np.degrees(told.first_rad + told.step_rad * np.arange(len(told.range_m)))
    assert np.isnan(told.range_m[np.abs(looks) < 35.0]).all() and not np.isnan(told.range_m[np.abs(looks) > 45.0]).any()
