"""The age of ranges is found from how they turn with the rover, and none where there is none."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as runs
from hypothesis import strategies as st

from companion.core.frames import Pose
from companion.core.scan import WIRED, RangeScan
from companion.perception.range_age import LEAST_S, RangeAges
from companion.vehicle.events import AttitudeSeen
from companion.vehicle.state import VehicleState
from tests.support.quick import examples

BEARINGS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
NORTH_M, EAST_M = 4.0, 3.0
"""Half the sides of a room; the rover drives round in it."""
PERIOD_S = 0.1


def to_and_fro(time_s: float) -> tuple[float, float]:
    """Heading and turn rate of a rover that turns this way and that."""
    return math.sin(time_s), math.cos(time_s)


def steadily(time_s: float) -> tuple[float, float]:
    return 0.8 * time_s, 0.8


def scan_at(time_s: float, heading_rad: float, place: tuple[float, float], noise_m: float = 0.0) -> RangeScan:
    courses_rad = heading_rad + BEARINGS_RAD
    north, east = np.cos(courses_rad), np.sin(courses_rad)
    to_north_m = np.where(north > 0.0, NORTH_M - place[0], NORTH_M + place[0]) / np.maximum(abs(north), 1e-9)
    to_east_m = np.where(east > 0.0, EAST_M - place[1], EAST_M + place[1]) / np.maximum(abs(east), 1e-9)
    scatter = np.random.default_rng(round(1e3 * time_s)).normal(0.0, noise_m, len(BEARINGS_RAD))
    ranges_m = np.minimum(to_north_m, to_east_m) + scatter
    return RangeScan(time_s, BEARINGS_RAD, ranges_m, 0.2, 12.0, math.radians(5.0), "OBSTACLE_DISTANCE")


def found_s(
    old_s: float,
    turns: Callable[[float], tuple[float, float]] = to_and_fro,
    lasts_s: float = 8.0,
    noise_m: float = 0.0,
    rolls_m_s: float = 0.2,
    **changes: object,
) -> float:
    """Of a rover that rolls along its heading, with scans so old."""
    ages, place, places = RangeAges(), np.zeros(2), [(0.0, 0.0)]
    times_s = np.arange(0.0, lasts_s, PERIOD_S / 10.0)
    for time_s in times_s[1:]:
        heading_rad, _ = turns(time_s)
        place = place + rolls_m_s * PERIOD_S / 10.0 * np.array([math.cos(heading_rad), math.sin(heading_rad)])
        places.append((float(place[0]), float(place[1])))
    for at in range(70, len(times_s), 10):
        then = at - round(old_s / (PERIOD_S / 10.0))
        scan = scan_at(times_s[then], turns(times_s[then])[0], places[then], noise_m)
        for time_s in (times_s[at] - 0.5 * PERIOD_S, times_s[at]):
            ages.hear(VehicleState(attitude=AttitudeSeen(time_s, time_s, *turns(time_s))))
        heading_rad, rate_rad_s = turns(times_s[at])
        scan = replace(scan, time_s=times_s[at], **changes)
        ages.note(scan, Pose(*places[at], heading_rad, times_s[at]), rolls_m_s, rate_rad_s)
    return ages.age_s(scan)


@runs(max_examples=examples(30), deadline=None)
@given(st.floats(0.08, 0.4), st.floats(0.0, 0.05))
def test_the_age_is_found_while_the_turn_rate_changes(age_s: float, noise_m: float) -> None:
    assert found_s(round(age_s, 2), noise_m=noise_m) == pytest.approx(round(age_s, 2), abs=0.03)


@runs(max_examples=examples(20), deadline=None)
@given(st.floats(0.0, 0.02), st.floats(0.0, 0.1))
def test_young_ranges_have_none(age_s: float, noise_m: float) -> None:
    assert found_s(round(age_s, 2), noise_m=noise_m) == 0.0


def test_an_even_turn_tells_nothing_nor_do_a_few_scans() -> None:
    assert found_s(0.2, steadily) == 0.0
    assert found_s(0.2, lasts_s=1.2) == 0.0
    assert found_s(0.2) > LEAST_S


def test_only_views_over_the_link_that_tell_no_ages_are_asked() -> None:
    assert found_s(0.2, sender=WIRED) == 0.0
    few = BEARINGS_RAD[:5]
    assert found_s(0.2, bearing_rad=few, range_m=np.full(5, 2.0)) == 0.0
    assert found_s(0.2, range_m=np.full(len(BEARINGS_RAD), math.inf)) == 0.0


def test_each_sensor_has_its_own() -> None:
    ages = RangeAges()
    for time_s in np.arange(1.0, 7.0, PERIOD_S):
        heading_rad, rate_rad_s = to_and_fro(time_s)
        ages.hear(VehicleState(attitude=AttitudeSeen(time_s, time_s, heading_rad, rate_rad_s)))
        for sensor, age_s in (("young", 0.0), ("old", 0.2)):
            scan = scan_at(time_s, to_and_fro(time_s - age_s)[0], (0.0, 0.0))
            scan = replace(scan, source=sensor)
            ages.note(scan, Pose(0.0, 0.0, heading_rad, time_s), 0.0, rate_rad_s)
    assert ages.age_s(replace(scan, source="young")) == 0.0
    assert ages.age_s(replace(scan, source="old")) == pytest.approx(0.2, abs=0.03)
    assert ages.age_s(replace(scan, source="silent")) == 0.0


@pytest.mark.parametrize("age_s", [0.13, 0.21, 0.26])
def test_it_is_found_between_those_that_are_tried(age_s: float) -> None:
    assert found_s(age_s, to_and_fro) == pytest.approx(age_s, abs=0.01)


def test_a_rover_that_rolls_while_it_turns_is_followed_back_on_its_way() -> None:
    """It rolls on a curve of 1 m/s and up to 1 rad/s."""
    assert found_s(0.2, rolls_m_s=1.0, lasts_s=4.0) == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("age_s", [0.61, 0.65])
def test_ranges_older_than_all_that_is_tried_have_none(age_s: float) -> None:
    """The least gap is that of the oldest one, and beyond it there may be less."""
    assert found_s(age_s) == 0.0


def compared(ages: RangeAges, age_s: float, since_s: float, until_s: float, period_s: float = PERIOD_S) -> list[float]:
    """What is found from scan to scan."""
    found = []
    for time_s in np.arange(since_s, until_s, period_s):
        heading_rad, rate_rad_s = to_and_fro(time_s)
        ages.hear(VehicleState(attitude=AttitudeSeen(time_s, time_s, heading_rad, rate_rad_s)))
        scan = scan_at(time_s, to_and_fro(time_s - age_s)[0], (0.0, 0.0))
        ages.note(scan, Pose(0.0, 0.0, heading_rad, time_s), 0.0, rate_rad_s)
        found.append(ages.age_s(scan))
    return found


def test_an_age_that_changes_is_found_anew() -> None:
    ages = RangeAges()
    assert compared(ages, 0.3, 1.0, 31.0)[-1] == pytest.approx(0.3, abs=0.02)
    assert compared(ages, 0.1, 31.0, 91.0)[-1] == pytest.approx(0.1, abs=0.02)


def test_scans_that_come_faster_are_not_compared_more_often() -> None:
    slow, fast = (compared(RangeAges(), 0.2, 1.0, 5.0, period_s) for period_s in (0.1, 0.02))
    times_s = (np.argmax(np.array(slow) > 0.0) * 0.1, np.argmax(np.array(fast) > 0.0) * 0.02)
    assert times_s[0] == pytest.approx(times_s[1], abs=0.25)


def test_an_age_that_was_found_does_not_come_and_go() -> None:
    """Near the least that counts, with noise."""
    found = [found_s(0.06, noise_m=0.08, lasts_s=lasts_s) > 0.0 for lasts_s in np.arange(3.0, 9.0, 0.1)]
    changes = sum(one != other for one, other in itertools.pairwise(found))
    assert changes <= 1


def test_a_scan_that_knows_its_ages_is_not_asked() -> None:
    assert found_s(0.2, age_s=np.zeros(len(BEARINGS_RAD))) == 0.0
