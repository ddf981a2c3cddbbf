"""Deskewing: what a rover sees while it moves is where it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.scan import RangeScan
from companion.perception.deskew import deskewed
from tests.support.lidars import desk, to_walls_m

RAYS = 90


@given(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0))
@settings(max_examples=40, deadline=None)
def test_points_taken_one_after_the_other_are_seen_as_from_the_last_place(speed_m_s: float, rate_rad_s: float) -> None:
    """Against the way of the rover in small steps."""
    age_s = np.linspace(0.2, 0.0, RAYS)
    rng = np.random.default_rng(1)
    points = rng.uniform(-6.0, 6.0, (RAYS, 2))  # forward and right of the last place
    bearing, ranges = np.empty(RAYS), np.empty(RAYS)
    for number in range(RAYS):
        steps = 200
        x = y = heading = 0.0
        for _ in range(steps):  # back in time
            part_s = age_s[number] / steps
            x -= speed_m_s * part_s * math.cos(heading - 0.5 * rate_rad_s * part_s)
            y -= speed_m_s * part_s * math.sin(heading - 0.5 * rate_rad_s * part_s)
            heading -= rate_rad_s * part_s
        forward, right = points[number] - (x, y)
        bearing[number] = math.atan2(right, forward) - heading
        ranges[number] = math.hypot(forward, right)
    scan = RangeScan(0.0, bearing, ranges, 0.1, 12.0, 0.01, "x", age_s=age_s)
    found = deskewed(scan, speed_m_s, rate_rad_s)
    seen = np.column_stack((np.cos(found.bearing_rad), np.sin(found.bearing_rad))) * found.range_m[:, None]
    assert np.abs(seen - points).max() < 1e-3
    assert found.age_s is None


def test_of_a_ray_that_met_nothing_the_direction_turns() -> None:
    scan = RangeScan(0.0, np.zeros(2), np.array([math.inf, math.nan]), 0.1, 8.0, 0.01, "x", age_s=np.array([0.1, 0.1]))
    found = deskewed(scan, 1.0, 1.0)
    assert found.bearing_rad == pytest.approx([-0.1, -0.1])
    assert math.isinf(found.range_m[0]) and math.isnan(found.range_m[1])


def test_a_scan_without_ages_stays_as_it_is() -> None:
    scan = RangeScan(0.0, np.array([0.3]), np.array([2.0]), 0.1, 8.0, 0.01, "x")
    assert deskewed(scan, 2.0, 1.0).bearing_rad.tolist() == [0.3]


@pytest.mark.parametrize("name", ["LD19", "RPLIDAR-A1", "YDLIDAR-X4"])
def test_a_lidar_on_a_rover_that_turns_sees_straight_walls(name: str) -> None:
    """90 degrees a second: smeared by 9 to 16 degrees without."""
    rig = desk(name)
    rate_rad_s = math.radians(90.0)
    scan = rig.run(1.5, rate_rad_s=rate_rad_s)[-1]
    heading_rad = rate_rad_s * scan.time_s
    found = deskewed(scan, 0.0, rate_rad_s)
    error_m, raw_m = (np.abs(one.range_m - to_walls_m(one.bearing_rad + heading_rad)) for one in (found, scan))
    assert np.nanpercentile(error_m, 95) < 0.12
    assert np.nanpercentile(raw_m, 95) > 0.4
