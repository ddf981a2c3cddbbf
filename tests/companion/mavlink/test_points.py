"""What points of OBSTACLE_DISTANCE_3D mean, and how those of one look become a scan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.scan import RangeScan
from companion.mavlink.codec import Codec
from companion.mavlink.points import SECTOR_RAD
from companion.settings import LinkSettings
from companion.vehicle.events import RangeSeen
from tests.support.mavlink_vehicle import Station

FRD, LOCAL_NED = 12, 1
NEAR_M, FAR_M = 0.3, 6.0
CAMERA = Station(1, 196)


def point(stamp_ms: int, x_m: float, y_m: float, z_m: float = 0.0, **changed: Any) -> bytes:
    fields = {"frame": FRD, "min_m": NEAR_M, "max_m": FAR_M, "kind": 4, **changed}
    return fields.get("station", CAMERA).pack(
        mavlink.MAVLink_obstacle_distance_3d_message(
            stamp_ms, fields["kind"], fields["frame"], 65535, x_m, y_m, z_m, fields["min_m"], fields["max_m"]
        )
    )


class Listener:
    """A codec that knows its vehicle, and hears one look after another."""

    def __init__(self, **settings: float) -> None:
        self.codec = Codec(LinkSettings(**settings))  # type: ignore[arg-type]
        self.rover = Station(1, 1)
        self.codec.decode(self.rover.heartbeat(), 0.0)

    def scans(self, raw: bytes, time_s: float) -> list[RangeScan]:
        return [event.scan for event in self.codec.decode(raw, time_s) if isinstance(event, RangeSeen)]

    def look(self, *points: bytes) -> list[RangeScan]:
        """The scans of points that come at 10 s, once the rover is heard at the next tick."""
        assert self.scans(b"".join(points), 10.0) == []
        return self.scans(self.rover.heartbeat(), 10.05)


def ranges(scan: RangeScan) -> dict[int, float]:
    """Ranges that are known, by the bearing of their sector's beginning in degrees."""
    begins = np.rint(np.degrees(scan.bearing_rad - SECTOR_RAD / 2.0)).astype(int).tolist()
    pairs = zip(begins, scan.range_m.tolist(), strict=True)
    return {begin: range_m for begin, range_m in pairs if not math.isnan(range_m)}


def test_points_lie_clockwise_from_ahead_and_ranges_are_along_the_ground() -> None:
    (scan,) = Listener().look(point(1, 3.0, 0.1, -0.5), point(1, 0.1, 2.0), point(1, -0.1, -1.0))
    assert ranges(scan) == pytest.approx({0: math.hypot(3.0, 0.1), 85: math.hypot(2, 0.1), -100: math.hypot(1, 0.1)})
    assert (scan.min_range_m, scan.max_range_m) == pytest.approx((NEAR_M, FAR_M))
    assert (scan.time_s, scan.sender, scan.beam_width_rad) == (10.0, 196, SECTOR_RAD)


def test_at_the_maximum_and_beyond_nothing_is_seen_but_an_obstacle_at_another_height_counts() -> None:
    (scan,) = Listener().look(
        point(1, 6.0, 0.1), point(1, 2.0, 0.1, -0.8), point(1, 6.0, 1.0), point(1, 9.0, -1.0), point(1, 0.1, 0.05)
    )
    found = ranges(scan)
    assert found[0] == pytest.approx(math.hypot(2.0, 0.1)) and found[5] == math.inf and found[-10] == math.inf
    assert found[25] == pytest.approx(math.hypot(0.1, 0.05)), "nearer than the minimum: an obstacle all the same"


@pytest.mark.parametrize(
    "nothing",
    [
        point(1, 2.0, 0.0, frame=LOCAL_NED),
        point(1, 2.0, 0.0, 0.2),  # the ground
        point(1, 2.0, 0.0, -1.1),  # a branch above the rover
        point(1, 0.0, 0.0),
        point(1, math.nan, 0.0),
        point(1, 2.0, 0.0, min_m=6.0, max_m=6.0),
        point(1, 2.0, 0.0, max_m=math.inf),
    ],
)
def test_points_that_say_nothing(nothing: bytes) -> None:
    assert Listener().look(nothing) == []


def test_the_band_of_heights_is_a_setting() -> None:
    low, high = point(1, 2.0, 0.1, 0.25), point(1, 2.0, 0.5, -1.5)
    assert set(ranges(Listener(points_below_m=0.3).look(low, high)[0])) == {0}
    assert set(ranges(Listener(points_above_m=2.0).look(low, high)[0])) == {10}


def test_a_new_stamp_ends_a_look_at_once_and_nothing_is_told_twice() -> None:
    ear = Listener()
    assert ear.scans(point(1, 2.0, 0.1), 10.0) == []
    (first,) = ear.scans(point(2, 3.0, 0.1), 10.0)
    assert ranges(first)[0] == pytest.approx(math.hypot(2.0, 0.1))
    (second,) = ear.scans(ear.rover.heartbeat(), 10.05)
    assert ranges(second)[0] == pytest.approx(math.hypot(3.0, 0.1))
    assert ear.scans(ear.rover.heartbeat(), 10.1) == [] and ear.scans(point(3, 2.0, 0.1), 10.1) == []


def test_points_that_come_late_are_added_to_their_look() -> None:
    ear = Listener()
    (early,) = ear.look(point(1, 6.0, 0.1))
    assert ranges(early)[0] == math.inf
    assert ear.scans(point(1, 2.0, 0.1), 10.05) == []
    (whole,) = ear.scans(ear.rover.heartbeat(), 10.1)
    assert ranges(whole)[0] == pytest.approx(math.hypot(2.0, 0.1))


def test_two_cameras_and_two_sensors_of_one_are_not_mixed() -> None:
    other = Station(1, 197)
    looks = [point(1, 2.0, 0.1), point(1, 3.0, 0.1, station=other), point(1, 4.0, 0.1, kind=0)]
    scans = Listener().look(*looks)
    assert sorted((scan.sender, round(float(scan.range_m[0]))) for scan in scans) == [(196, 2), (196, 4), (197, 3)]
    assert len({scan.voice for scan in scans}) == 3


def test_a_flood_of_sensors_takes_no_more_memory() -> None:
    ear = Listener()
    for component in range(2, 250):
        ear.scans(point(1, 2.0, 0.1, station=Station(1, component)), 10.0)
    joiner = ear.codec._decoder._ranges._points
    assert len(joiner._open) <= 20


POINTS = st.tuples(*[st.floats(-9.0, 9.0, width=32)] * 2, st.floats(-2.0, 2.0, width=32))


@given(st.lists(POINTS, min_size=1, max_size=40))
def test_a_sector_is_free_only_if_no_point_of_it_is_an_obstacle(places: Sequence[tuple[float, float, float]]) -> None:
    found: dict[int, float] = {}
    for scan in Listener().look(*(point(1, *place) for place in places)):
        found = ranges(scan)
    for x_m, y_m, z_m in places:
        across_m = math.hypot(x_m, y_m)
        if across_m < 1e-3 or not -1.0 <= z_m <= 0.1 or math.hypot(across_m, z_m) > FAR_M - 1e-3:
            continue
        turn = (math.degrees(math.atan2(y_m, x_m)) + 180.0) / 5.0
        if abs(turn - round(turn)) < 1e-6:
            continue
        assert found[int(turn) % 72 * 5 - 180] <= across_m + 1e-5


@given(st.lists(st.binary(min_size=28, max_size=28), max_size=6))
def test_any_values_are_survived(payloads: list[bytes]) -> None:
    ear, kind = Listener(), mavlink.mavlink_map[11037]
    for number, payload in enumerate(payloads):
        head = bytes([len(payload), 0, 0, number, 1, 196]) + (11037).to_bytes(3, "little")
        check = int(mavlink.x25crc(head + payload + bytes([kind.crc_extra])).crc)
        for scan in ear.scans(b"\xfd" + head + payload + check.to_bytes(2, "little"), 10.0 + 0.05 * number):
            assert len(scan.range_m) == len(scan.bearing_rad) > 0 and 0.0 <= scan.min_range_m < scan.max_range_m


def test_looks_that_wait_on_their_way_are_late_by_their_own_clock() -> None:
    listener, late_s = Listener(), []
    for number in range(60):
        made_s, waited_s = 0.1 * number, 0.06 if number % 4 == 3 else 0.0
        raw = b"".join(point(round(1e3 * made_s), 2.0, aside_m) for aside_m in (-0.5, 0.5))
        late_s += [scan.late_s for scan in listener.scans(raw, 10.0 + made_s + waited_s)]
    assert late_s[35:] == pytest.approx([0.06 if number % 4 == 3 else 0.0 for number in range(59)][35:], abs=0.002)
