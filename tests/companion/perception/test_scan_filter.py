"""Of a flood of scans the newest of each sensor; and notice of a sensor that repeats itself, of no other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.core.scan import WIRED, RangeScan
from companion.perception.scan_filter import MOST_SCANS, SAME, STUCK_M, STUCK_S, ScanWatch, newest_ranges
from companion.vehicle.events import (
    AttitudeSeen,
    Event,
    LocalPositionSeen,
    RangeSeen,
    TextSeen,
)
from companion.vehicle.state import VehicleState
from tests.support.shared_data import SHARED, needs_shared

# --- the newest of each sensor ---------------------------------------------------------------------------------------


def seen(time_s: float, source: str = "obstacle distance", bearing_deg: float = 0.0, sender: int = 1) -> RangeSeen:
    scan = RangeScan(time_s, np.array([math.radians(bearing_deg)]), np.array([3.0]), 0.2, 8.0, 0.1, source, sender)
    return RangeSeen(time_s, scan)


def test_what_comes_in_an_ordinary_tick_is_all_taken_in() -> None:
    events: list[Event] = [seen(1.0), TextSeen(1.0, 6, "a"), *(seen(1.0, "sector 10", 45.0 * i) for i in range(8))]
    events += [seen(1.0), seen(1.0, "rangefinder")]
    assert newest_ranges(events) == events


def test_of_a_flood_the_newest_of_each_kind_remain_in_their_order() -> None:
    flood: list[Event] = [seen(float(i)) for i in range(50)]
    beam = seen(0.5, "distance sensor 1", 90.0)
    kept = newest_ranges([beam, *flood, TextSeen(50.0, 6, "a")])
    assert kept == [beam, *flood[-SAME:], TextSeen(50.0, 6, "a")]


def test_a_flood_of_one_sender_leaves_the_same_message_of_another_in_its_place() -> None:
    lidar = seen(0.0, sender=196)
    flood = [seen(float(i), f"distance sensor {i % 6}", sender=158) for i in range(50)]
    again = [seen(float(i), sender=158) for i in range(50)]
    kept = newest_ranges([lidar, *flood, *again])
    assert kept[0] is lidar and len(kept) == MOST_SCANS and kept[-SAME:] == again[-SAME:]


def test_kinds_without_end_are_too_many_and_nothing_but_range_data_is_left_out() -> None:
    texts = [TextSeen(float(i), 6, "a") for i in range(100)]
    kept = newest_ranges([*texts, *(seen(float(i), f"distance sensor {i}") for i in range(250))])
    assert kept[:100] == texts
    assert [event.time_s for event in kept[100:]] == [float(i) for i in range(250 - MOST_SCANS, 250)]


# --- a sensor that repeats itself ------------------------------------------------------------------------------------

VIEW_RAD = np.radians(np.arange(-45.0, 45.0, 1.25))
MOTION = {"standing": (0.0, 0.0), "driving": (1.0, 0.0), "turning": (0.0, 0.5)}


def scan(time_s: float, range_m: list[float], bearing_rad: list[float] | None = None, name: str = "lidar") -> RangeScan:
    bearings = VIEW_RAD[: len(range_m)] if bearing_rad is None else np.array(bearing_rad)
    return RangeScan(time_s, bearings, np.array(range_m), 0.1, 8.0, math.radians(1.25), name)


def vehicle(time_s: float, speed_m_s: float, rate_rad_s: float) -> VehicleState:
    return VehicleState(
        position=LocalPositionSeen(time_s, time_s, 0.0, 0.0, speed_m_s, 0.0),
        attitude=AttitudeSeen(time_s, time_s, 0.0, rate_rad_s),
    )


def noticed_s(readings: list[float], motion: str, bearing_rad: list[float] | None = None, name: str = "lidar") -> float:
    """When the same readings are noticed, sent ten times a second for 5 s; inf: never."""
    watch = ScanWatch()
    for i in range(50):
        watch.take(scan(0.1 * i, readings, bearing_rad, name), vehicle(0.1 * i, *MOTION[motion]))
        if watch.repeating:
            return 0.1 * i
    return math.inf


MANY = [1.0 + 0.01 * i for i in range(72)]
NOTHING = [math.inf] * 72
WALL = [math.inf] * 70 + [7.1, 6.9]
ALONE = [2.15] + [math.inf] * 71
ROUND_RAD = [math.radians(290.0 + 5.0 * i) for i in range(72)]
ASIDE_RAD = [math.radians(272.0 + 5.0 * i) for i in range(72)]


@pytest.mark.parametrize(
    ("readings", "bearing_rad", "motion", "limit_s"),
    [
        (MANY, None, "driving", STUCK_S + 0.1),
        (MANY, None, "turning", STUCK_S + 0.1),
        (MANY, None, "standing", math.inf),
        (NOTHING, None, "driving", math.inf),
        (NOTHING, None, "turning", math.inf),
        (WALL, None, "driving", 1.2),
        ([0.3 + 0.001 * i for i in range(72)], None, "driving", math.inf),  # a mast in the way
        ([math.nan] * 30 + MANY[:42], None, "driving", STUCK_S + 0.1),
        ([3.0], [0.0], "driving", STUCK_S + 0.1),  # one thin beam, straight ahead
        ([3.0], [math.pi], "driving", STUCK_S + 0.1),
        ([3.0], [math.radians(45.0)], "driving", math.inf),  # beside a wall
        ([3.0], [math.radians(45.0)], "turning", STUCK_S + 0.1),
        ([math.inf], [0.0], "driving", math.inf),
        ([3.0] * 40, None, "driving", math.inf),  # a wide sonar, or a proximity sector
        (ALONE, ROUND_RAD, "driving", 1.2),
        (ALONE, ROUND_RAD, "turning", STUCK_S + 0.1),
        (ALONE, ASIDE_RAD, "driving", math.inf),  # a wall beside, of which no more is in reach
        ([1.2] + [math.inf] * 71, ROUND_RAD, "driving", math.inf),  # a mast
    ],
)
def test_the_same_readings_are_noticed_when_they_would_have_to_change(readings, bearing_rad, motion, limit_s):
    found_s = noticed_s(readings, motion, bearing_rad)
    assert found_s <= limit_s and math.isfinite(found_s) == math.isfinite(limit_s)
    assert found_s >= STUCK_S


def turn(time_s: float, lost: int, range_m: np.ndarray, bearing_rad: np.ndarray) -> RangeScan:  # type: ignore[type-arg]
    """A turn of a wired lidar, without 24 readings from the one with this number on, and one of them unknown."""
    kept = np.delete(np.arange(len(range_m)), np.arange(lost, lost + 24))
    known_m = range_m[kept]
    known_m[lost % len(kept)] = math.nan
    return RangeScan(time_s, bearing_rad[kept], known_m, 0.02, 12.0, math.radians(0.8), "lidar 1", WIRED)


def test_a_wired_lidar_that_repeats_itself_on_a_line_that_loses_bytes_is_noticed_and_stays_so() -> None:
    """Until its readings really differ: one damaged reading is not enough."""
    bearing_rad = np.radians(np.arange(0.0, 360.0, 0.8))
    range_m, watch = 3.0 + np.sin(bearing_rad), ScanWatch()
    for i in range(30):
        sent_m = range_m.copy()
        sent_m[7 * i % 450] += 1.0 * (i % 3 == 0)
        watch.take(turn(0.1 * i, 31 * i % 420, sent_m, bearing_rad + 1e-4 * (i % 2)), vehicle(0.1 * i, 1.0, 0.0))
        assert (watch.repeating is not None) == (i >= 5)
    watch.take(turn(3.0, 0, range_m + 0.05 * np.cos(bearing_rad), bearing_rad), vehicle(3.0, 1.0, 0.0))
    assert watch.repeating is None


def test_a_wired_lidar_that_sees_the_room_come_nearer_does_not_repeat_itself() -> None:
    bearing_rad, watch = np.radians(np.arange(0.0, 360.0, 0.8)), ScanWatch()
    for i in range(30):
        seen_m = np.minimum(2.0 / np.abs(np.sin(bearing_rad + 1e-9)), (9.0 - 0.03 * i) / np.abs(np.cos(bearing_rad)))
        assert watch.take(turn(0.1 * i, 31 * i % 420, seen_m, bearing_rad), vehicle(0.1 * i, 0.3, 0.0))
    assert watch.repeating is None


def test_a_wired_lidar_whose_turns_look_in_other_directions_each_does_not_repeat_itself() -> None:
    """As those of an A1, which takes 363.6 readings a turn."""
    bearing_rad, watch = np.radians(np.arange(0.0, 360.0, 0.99)), ScanWatch()
    for i in range(30):
        at_rad = bearing_rad + math.radians(0.37) * (i % 2)
        watch.take(turn(0.1 * i, 0, 3.0 + np.sin(at_rad) + 0.1 * i, at_rad), vehicle(0.1 * i, 1.0, 0.0))
        assert watch.repeating is None


def test_the_nearest_of_all_sensors_may_look_at_a_wall_all_day():
    assert noticed_s([3.0], "driving", [0.0], "rangefinder") == math.inf


def test_a_sensor_that_measures_three_times_a_second_and_is_sent_thirty_times_is_no_fault():
    watch, fits = ScanWatch(), 0
    for i in range(300):
        measured = [one + 0.02 * (i // 10) for one in MANY]
        fits += watch.take(scan(i / 30.0, measured), vehicle(i / 30.0, *MOTION["driving"]))
        assert watch.repeating is None
    assert 30 <= fits <= 90, "what is repeated while the rover drives is not put on the map again"


def test_it_is_believed_again_when_it_says_something_else_and_another_sensor_does_not_hide_it():
    watch = ScanWatch()
    for i in range(20):
        watch.take(scan(0.1 * i, MANY), vehicle(0.1 * i, *MOTION["driving"]))
        watch.take(scan(0.1 * i, [2.0 + 0.01 * i] * 8, name="other"), vehicle(0.1 * i, *MOTION["driving"]))
    assert watch.repeating == "lidar"
    for i in range(20, 40):
        assert not watch.take(scan(0.1 * i, MANY), vehicle(0.1 * i, *MOTION["standing"])), "standing heals nothing"
    assert watch.repeating
    assert watch.take(scan(4.0, [one + 0.01 for one in MANY]), vehicle(4.0, *MOTION["standing"]))
    assert watch.repeating is None


def test_a_stuck_sensor_does_not_hide_behind_another_component_with_the_same_message():
    watch = ScanWatch()
    for i in range(20):
        watch.take(scan(0.1 * i, MANY), vehicle(0.1 * i, *MOTION["driving"]))
        another = replace(scan(0.1 * i, [2.0 + 0.01 * i] * 72), sender=158)
        watch.take(another, vehicle(0.1 * i, *MOTION["driving"]))
    assert watch.repeating == "lidar"


@needs_shared
@pytest.mark.parametrize("max_m", [2.0, 4.5, 8.0])
def test_a_real_lidar_on_a_real_rover_raises_no_alarm(max_m: float) -> None:
    """A Hokuyo on the MinesRover through rooms, in 72 cells of whole centimetres as OBSTACLE_DISTANCE has them."""
    lines = (SHARED / "data/lidar/breezyslam/exp2.dat").read_text(encoding="utf-8").splitlines()
    rows = [np.array(line.split(), float) for line in lines if line.strip()]
    watch, before, driving = ScanWatch(), rows[0], 0
    for row in rows[1:]:
        elapsed_s = (row[0] - before[0]) / 1e6
        left_m, right_m = 2.0 * math.pi * 0.077 * (row[2:4] - before[2:4]) / 2000.0
        motion = abs(left_m + right_m) / 2.0 / elapsed_s, (right_m - left_m) / 0.33 / elapsed_s
        cells = np.array([part[part > 50].min(initial=1e9) for part in np.array_split(row[24:706], 72)])
        range_m = np.where(cells / 1000.0 < max_m, np.round(cells / 1000.0, 2), np.inf)
        watch.take(
            scan(row[0] / 1e6, range_m.tolist(), np.radians(np.linspace(-120, 120, 72)).tolist()),
            vehicle(row[0] / 1e6, *motion),
        )
        assert watch.repeating is None
        driving += motion[0] > 2 * STUCK_M
        before = row
    assert driving > 100
