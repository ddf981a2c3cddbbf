"""Where the rover will be: against the same motion in small steps."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.control.braking import braking_distance_m
from companion.control.motion_prediction import (
    PERIOD_S,
    braked_m,
    driven_m,
    moved,
    moved_on_arc,
    places_ahead,
    steered_along,
)
from companion.core.frames import Pose
from companion.settings import GuidanceSettings

SETTINGS = GuidanceSettings()
TIMES_S = np.arange(0.0, 8.0, PERIOD_S)
HERE = Pose(3.0, 4.0, math.radians(30.0), 0.0)
LINE = np.column_stack((np.arange(0.0, 12.0, 0.25), np.zeros(48)))
SPEEDS = st.floats(0.0, 3.0)


@given(SPEEDS)
def test_a_braked_rover_stands_after_its_braking_distance(speed_m_s: float) -> None:
    rolled_m = braked_m(speed_m_s, TIMES_S, SETTINGS)
    assert rolled_m[0] == 0.0 and (np.diff(rolled_m) >= -1e-12).all()
    assert rolled_m[-1] == pytest.approx(braking_distance_m(speed_m_s, SETTINGS))


@given(SPEEDS, SPEEDS, st.floats(0.2, 6.0))
def test_a_rover_that_goes_on_reaches_its_speed_and_stops_after_its_time(
    speed_m_s: float, goal_m_s: float, goes_s: float
) -> None:
    along_m = driven_m(speed_m_s, goal_m_s, goes_s, np.arange(0.0, 20.0, PERIOD_S), SETTINGS)
    speeds_m_s = np.diff(along_m) / PERIOD_S
    assert along_m[0] == 0.0 and (speeds_m_s >= -1e-9).all()
    assert speeds_m_s.max() <= max(goal_m_s, speed_m_s) + 1e-9
    assert speeds_m_s[-1] == pytest.approx(0.0, abs=1e-9)


def test_without_an_end_it_goes_on_for_ever() -> None:
    along_m = driven_m(0.0, 1.0, math.inf, TIMES_S, SETTINGS)
    assert np.diff(along_m)[-1] == pytest.approx(PERIOD_S)


def test_places_lie_ahead_aside_and_behind() -> None:
    along_m = np.array([0.0, 1.0, -2.0])
    there = places_ahead(HERE, along_m)
    assert there[1] == pytest.approx((3.0 + math.cos(math.radians(30.0)), 4.0 + math.sin(math.radians(30.0))))
    assert there[2] == pytest.approx((3.0 - 2.0 * math.cos(math.radians(30.0)), 4.0 - 1.0))
    aside = moved(there, math.radians(120.0), np.full(3, 2.0))
    assert aside[0] == pytest.approx((3.0 - 1.0, 4.0 + math.sqrt(3.0)))


@given(st.floats(-1.0, 1.0), st.floats(-3.2, 3.2))
def test_an_arc_is_what_small_steps_make_of_it(curvature_per_m: float, course_rad: float) -> None:
    north_m, east_m, course = HERE.north_m, HERE.east_m, course_rad
    for _ in range(1000):
        course += 0.5 * curvature_per_m * 0.003
        north_m, east_m = north_m + 0.003 * math.cos(course), east_m + 0.003 * math.sin(course)
        course += 0.5 * curvature_per_m * 0.003
    there = moved_on_arc(HERE, course_rad, curvature_per_m, np.array([0.0, 3.0]))
    assert there[0] == pytest.approx((HERE.north_m, HERE.east_m))
    assert there[1] == pytest.approx((north_m, east_m), abs=1e-4)


@settings(deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(0.2, 2.0), st.sampled_from([0.0, 1.0, 2.5]))
def test_along_a_line_it_turns_no_faster_than_it_can(course_rad: float, speed_m_s: float, radius_m: float) -> None:
    along_m = speed_m_s * TIMES_S
    places = steered_along(LINE, course_rad, along_m, radius_m)
    assert tuple(places[0]) == (0.0, 0.0) and np.isfinite(places).all()
    steps = np.diff(places, axis=0)
    assert np.hypot(*steps.T) == pytest.approx(np.diff(np.minimum(along_m, 11.75)))
    driven = np.hypot(*steps.T) > 1e-6
    courses = np.unwrap(np.arctan2(steps[driven, 1], steps[driven, 0]))
    most_rad = 1.2 * PERIOD_S if radius_m == 0.0 else min(1.2 * PERIOD_S, speed_m_s * PERIOD_S / radius_m)
    assert np.abs(np.diff(courses)).max(initial=0.0) <= most_rad + 1e-9


def test_along_a_line_ahead_it_stays_on_it_and_ends_with_it() -> None:
    places = steered_along(LINE, 0.0, 2.0 * TIMES_S, 0.0)
    assert np.allclose(places[:, 1], 0.0) and places[-1, 0] == pytest.approx(11.75)
