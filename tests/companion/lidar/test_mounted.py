"""Mounting: a scan counts from the rover's middle, whichever way the lidar sits on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.scan import WIRED, RangeScan
from companion.lidar.mounted import cut_deg, scan_of
from companion.lidar.points import Points
from companion.lidar.spec import Mounting, parsed
from companion.lidar.turns import Turn
from tests.support.lidars import desk, faulty, to_walls_m


def turn_of(angle_deg: Any, range_m: Any, quality: Any = 100.0) -> Turn:
    angle_deg = np.asarray(angle_deg, np.float64)
    values = [np.broadcast_to(np.asarray(one, np.float64), angle_deg.shape).copy() for one in (range_m, quality)]
    return Turn(1.0, np.zeros(len(angle_deg)), Points(angle_deg, *values))


def scan(options: str, angle_deg: Any, range_m: Any, quality: Any = 100.0) -> RangeScan:
    return scan_of(turn_of(angle_deg, range_m, quality), parsed(f"LD19:desk:{options}").mounting, "lidar 1")


@pytest.mark.parametrize(
    ("options", "seen_deg"), [("yaw=0", 30.0), ("yaw=90", 120.0), ("flip", -30.0), ("yaw=90,flip", 60.0)]
)
def test_direction(options: str, seen_deg: float) -> None:
    assert np.degrees(scan(options, [30.0], [2.0]).bearing_rad[0]) == pytest.approx(seen_deg)


def test_a_lidar_before_and_beside_the_middle() -> None:
    found = scan("x=1,y=2", [0.0, 90.0], [3.0, 0.0])
    assert found.range_m[0] == pytest.approx(math.hypot(4.0, 2.0))
    assert found.bearing_rad[0] == pytest.approx(math.atan2(2.0, 4.0))
    assert math.isinf(found.range_m[1]) and found.bearing_rad[1] == pytest.approx(math.pi / 2.0)
    assert found.origin_m == (1.0, 2.0)


@pytest.mark.parametrize(
    ("options", "range_m", "quality", "seen_m"),
    [
        ("min=0.5", 0.4, 100, math.nan),
        ("min=0.5", 0.5, 100, 0.5),
        ("max=4", 4.0, 100, math.inf),
        ("max=4", 3.99, 100, 3.99),
        ("intensity=50", 2.0, 49, math.nan),
        ("intensity=50", 2.0, 50, 2.0),
        ("intensity=50", 0.0, 0, math.inf),
        ("empty=0", 0.0, 0, math.nan),
        ("empty=0,max=4", 6.0, 100, math.nan),
        ("mask=350..10", 2.0, 100, math.nan),
        ("mask=10..350", 2.0, 100, 2.0),
        ("mask=-5..5", 0.0, 0, math.nan),
    ],
)
def test_which_readings_count(options: str, range_m: float, quality: int, seen_m: float) -> None:
    assert scan(options, [0.0], [range_m], [quality]).range_m[0] == pytest.approx(seen_m, nan_ok=True)


def test_masks_are_directions_of_the_rover_not_of_the_lidar() -> None:
    found = scan("yaw=90,mask=85..95", [0.0, 90.0], [2.0, 2.0])
    assert math.isnan(found.range_m[0]) and found.range_m[1] == 2.0


def test_a_scan_says_whose_it_is_and_how_far_it_speaks() -> None:
    found = scan("empty=3", np.arange(0.0, 360.0, 0.8), 2.0)
    assert (found.sender, found.source, found.min_range_m, found.max_range_m) == (WIRED, "lidar 1", 0.02, 12.0)
    assert found.empty_m == 3.0 and math.degrees(found.beam_width_rad) == pytest.approx(0.8)
    assert found.looks_ahead and not found.is_narrow


@given(
    range_m=st.lists(st.floats(0.0, 65.0), min_size=1, max_size=40),
    first_deg=st.floats(0.0, 359.0),
    yaw_deg=st.integers(-180, 180),
    flipped=st.booleans(),
)
@settings(deadline=None)
def test_never_a_range_outside_the_limits(range_m: list[float], first_deg: float, yaw_deg: int, flipped: bool) -> None:
    mounting = Mounting(0.3, 9.0, float(yaw_deg), flipped=flipped)
    angles_deg = (first_deg + np.arange(len(range_m))) % 360.0
    found = scan_of(turn_of(angles_deg, range_m), mounting, "x")
    hit = found.range_m[np.isfinite(found.range_m)]
    assert np.all((hit >= 0.3) & (hit < 9.0))
    assert np.all(np.abs(found.bearing_rad) <= math.pi + 1e-9)


@pytest.mark.parametrize("name", ["LD19", "RPLIDAR-A1", "YDLIDAR-X4"])
@pytest.mark.parametrize("options", ["", "yaw=70", "flip", "yaw=-100,flip", "yaw=30,x=0.5,y=-0.3,flip"])
def test_however_it_is_mounted_the_room_is_where_it_is(name: str, options: str) -> None:
    where = parsed(f"{name}:desk:{options}").mounting
    place = {"forward_m": where.forward_m, "right_m": where.right_m, "flipped": where.flipped}
    found = desk(name, options, yaw_rad=math.radians(where.yaw_deg), **place).run(0.8)
    assert len(found) >= 2
    for one in found:
        hit = np.isfinite(one.range_m)
        assert hit.mean() > 0.95
        assert np.abs(one.range_m[hit] - to_walls_m(one.bearing_rad[hit])).max() < 0.05


@pytest.mark.parametrize("options", ["", "flip", "yaw=120", "yaw=-60,flip"])
def test_the_readings_ahead_are_the_newest_of_each_scan(options: str) -> None:
    where = parsed(f"LD19:desk:{options}").mounting
    one = desk("LD19", options, yaw_rad=math.radians(where.yaw_deg), flipped=where.flipped).run(0.5)[-1]
    assert one.age_s is not None
    ahead = np.abs(one.bearing_rad) < math.radians(20.0)
    assert one.age_s[ahead].max() < 0.02 < one.age_s.max()
    assert 0.0 <= cut_deg(where) < 360.0


def test_noise_of_a_fault_shows() -> None:
    rig = desk("LD19")
    rig.device.faults = faulty(noise_m=0.1)
    one = rig.run(0.5)[-1]
    error_m = one.range_m - to_walls_m(one.bearing_rad)
    assert 0.07 < np.nanstd(error_m) < 0.13
