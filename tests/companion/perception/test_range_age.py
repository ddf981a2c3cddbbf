"""The age of ranges is found from how they turn with the rover, and none where there is none."""

from __future__ import annotations

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
    age_s: float,
    turns: Callable[[float], tuple[float, float]] = to_and_fro,
    lasts_s: float = 8.0,
    noise_m: float = 0.0,
    **changes: object,
) -> float:
    """Of a rover that rolls at 0.2 m/s along its heading, with scans so old."""
    ages, place, places = RangeAges(), np.zeros(2), [(0.0, 0.0)]
    times_s = np.arange(0.0, lasts_s, PERIOD_S / 10.0)
    for time_s in times_s[1:]:
        heading_rad, _ = turns(time_s)
        place = place + 0.2 * PERIOD_S / 10.0 * np.array([math.cos(heading_rad), math.sin(heading_rad)])
        places.append((float(place[0]), float(place[1])))
    for at in range(50, len(times_s), 10):
        then = at - round(age_s / (PERIOD_S / 10.0))
        scan = scan_at(times_s[then], turns(times_s[then])[0], places[then], noise_m)
        for time_s in (times_s[at] - 0.5 * PERIOD_S, times_s[at]):
            ages.hear(AttitudeSeen(time_s, time_s, *turns(time_s)))
        heading_rad, rate_rad_s = turns(times_s[at])
        scan = replace(scan, time_s=times_s[at], **changes)
        ages.note(scan, Pose(*places[at], heading_rad, times_s[at]), 0.2, rate_rad_s)
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
        ages.hear(AttitudeSeen(time_s, time_s, heading_rad, rate_rad_s))
        for sensor, age_s in (("young", 0.0), ("old", 0.2)):
            scan = scan_at(time_s, to_and_fro(time_s - age_s)[0], (0.0, 0.0))
            scan = replace(scan, source=sensor)
            ages.note(scan, Pose(0.0, 0.0, heading_rad, time_s), 0.0, rate_rad_s)
    assert ages.age_s(replace(scan, source="young")) == 0.0
    assert ages.age_s(replace(scan, source="old")) == pytest.approx(0.2, abs=0.03)
    assert ages.age_s(replace(scan, source="silent")) == 0.0
