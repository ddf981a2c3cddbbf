"""Meetings with moving obstacles: the exact answer against small steps in time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.papers.wang_moving_obstacles import (
    Stretch,
    exclusion,
    first_meeting,
    fit_shares,
    fleet_of,
    place,
)
from companion.planning.problem import ObstacleTrajectory
from tests.support.quick import examples

NUMBERS = st.floats(-20.0, 20.0)


def fleet(track, radius=2.0, safe=0.0, timing=0.0):
    return fleet_of((ObstacleTrajectory(radius, np.array(track, float)),), safe, timing)


@pytest.mark.parametrize(
    ("time_s", "expected"),
    [
        (0.0, (5, 5, 0, 0, 2)),
        (2.0, (5, 5, 1, 0, 6)),
        (4.0, (7, 5, 1, 0, 6)),
        (8.0, (9, 6, 0, 0.5, 10)),
        (99.0, (9, 7, 0, 0, np.inf)),
    ],
)
def test_place_before_between_and_behind_the_rows(time_s, expected):
    assert place(fleet([(2, 5, 5), (6, 9, 5), (10, 9, 7)]), 0, time_s) == pytest.approx(expected)


@given(
    points=st.lists(st.tuples(st.floats(0.1, 5.0), NUMBERS, NUMBERS), min_size=1, max_size=6),
    robot=st.tuples(NUMBERS, NUMBERS, st.floats(-3, 3), st.floats(-3, 3)),
    radius=st.floats(0.5, 5.0),
    begin_s=st.floats(0.0, 4.0),
)
@settings(max_examples=examples(200), deadline=None)
def test_first_meeting_agrees_with_small_steps(points, robot, radius, begin_s):
    track = np.array(points)
    track[:, 0] = np.cumsum(track[:, 0])
    x, y, speed_x, speed_y = robot
    found_s = first_meeting(fleet(track, radius), 0, Stretch(begin_s, begin_s + 10.0, x, y, speed_x, speed_y))
    times_s = np.arange(begin_s, begin_s + 10.0, 0.002)
    gaps = np.hypot(
        x + speed_x * (times_s - begin_s) - np.interp(times_s, track[:, 0], track[:, 1]),
        y + speed_y * (times_s - begin_s) - np.interp(times_s, track[:, 0], track[:, 2]),
    )
    close = np.flatnonzero(gaps < radius - 1e-6)
    if len(close):
        assert found_s <= times_s[close[0]] + 1e-6
    if np.isfinite(found_s):
        at = np.hypot(
            x + speed_x * (found_s - begin_s) - np.interp(found_s, track[:, 0], track[:, 1]),
            y + speed_y * (found_s - begin_s) - np.interp(found_s, track[:, 0], track[:, 2]),
        )
        assert at <= radius + 1e-6


def test_the_exclusion_area_grows_with_both_speeds_each_in_its_direction():
    moving = fleet([(0, 0, 0), (100, 100, 0)], radius=2.0, safe=0.5, timing=2.0)
    assert exclusion(moving, 0, 1.0, 0.5) == pytest.approx((4.5, 3.5))
    assert exclusion(moving, 0, 3.0, 0.5) == pytest.approx((8.5, 3.5))
    assert exclusion(moving, 0, 1.0, 2.0) == pytest.approx((4.5, 6.5))
    assert exclusion(moving, 0, 0.0, 2.0) == pytest.approx((2.5, 2.5))


@pytest.mark.parametrize(
    ("track", "meets"), [([(0, 10, 0), (20, -10, 0)], True), ([(0, 6, 0), (1, 6, 0)], True), ([(0, 0, 9)], False)]
)
def test_meetings_without_a_crossing_point(track, meets):
    """Head on, an obstacle that stands in the way, and one that stands aside."""
    assert np.isfinite(first_meeting(fleet(track), 0, Stretch(0.0, 10.0, 0.0, 0.0, 1.0, 0.0))) == meets


def test_margins_shrink_where_the_robot_is_inside_them_already():
    near = fleet([(0, 3, 0), (50, 53, 0)], radius=2.0, safe=1.0, timing=1.0)
    fit_shares(near, 0.0, 0.0, 1.0)
    assert near.shares[0] == 0.5
    far = fleet([(0, 30, 0), (50, 80, 0)], radius=2.0, safe=1.0, timing=1.0)
    fit_shares(far, 0.0, 0.0, 1.0)
    assert far.shares[0] == 1.0
    inside = fleet([(0, 1, 0), (50, 51, 0)], radius=2.0, safe=1.0, timing=1.0)
    fit_shares(inside, 0.0, 0.0, 1.0)
    assert inside.shares[0] == 0.0 and first_meeting(inside, 0, Stretch(0.0, 1.0, 0.0, 0.0, -1.0, 0.0)) == 0.0
