"""The way an inner target moves along a leg: within its limits, without jumps, and to the very end."""

import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.control.scurve import DONE, LENGTH, SPEED, START_SPEED, along, leg_times, ramp, ramp_s, top_speed
from tests.support.quick import examples

STEP_S = 0.02
ACCEL, JERK = st.floats(0.2, 5.0), st.floats(0.2, 20.0)


def leg_of(length_m: float, start: float, wish: float, accel: float, jerk: float) -> np.ndarray:
    leg = np.zeros(7)
    leg[LENGTH], leg[START_SPEED], leg[SPEED] = length_m, start, top_speed(length_m, start, wish, accel, jerk)
    return leg


@settings(max_examples=40, deadline=None)
@given(st.floats(0.05, 200.0), st.floats(0.1, 6.0), ACCEL, JERK)
def test_a_leg_from_rest_to_rest(length_m: float, wish: float, accel: float, jerk: float) -> None:
    leg = leg_of(length_m, 0.0, wish, accel, jerk)
    assert 0.0 < leg[SPEED] <= wish
    end_s = leg_times(leg, accel, jerk)[1]
    before = (0.0, 0.0, 0.0)
    for step in range(math.ceil(end_s / STEP_S) + 2):
        now = along(leg, step * STEP_S, accel, jerk)
        assert -1e-9 <= now[0] <= length_m + 1e-6 and now[0] >= before[0] - 1e-6
        assert -1e-6 <= now[1] <= leg[SPEED] + 1e-6
        assert abs(now[2]) <= accel + 1e-6
        assert abs(now[0] - before[0]) <= leg[SPEED] * STEP_S + 1e-6
        assert abs(now[1] - before[1]) <= accel * STEP_S + 1e-6
        assert abs(now[2] - before[2]) <= 2.0 * jerk * STEP_S + 1e-6
        before = now
    assert before == (length_m, 0.0, 0.0)


@settings(max_examples=examples(150), deadline=None)
@given(st.floats(0.0, 5.0), st.floats(0.1, 5.0), st.floats(0.0, 300.0), st.floats(0.0, 50.0), ACCEL, JERK)
def test_a_leg_begun_in_motion(
    start: float, wish: float, length_m: float, done_m: float, accel: float, jerk: float
) -> None:
    leg = leg_of(length_m, start, wish, accel, jerk)
    if leg[SPEED] <= 0.0:  # too short to stop in
        assert length_m < start * (start / accel + accel / jerk + 2.0 * math.sqrt(start / jerk)) + 1e-6
        return
    leg[LENGTH] += done_m
    leg[DONE] = done_m
    first = along(leg, 0.0, accel, jerk)
    assert math.isclose(first[0], done_m, abs_tol=1e-6)
    assert math.isclose(first[1], start, abs_tol=1e-9)
    end_s = leg_times(leg, accel, jerk)[1]
    places = [along(leg, share * end_s, accel, jerk)[0] for share in np.linspace(0.0, 1.0, 200)]
    assert all(b >= a - 1e-6 for a, b in pairwise(places))
    assert math.isclose(places[-1], length_m + done_m, abs_tol=1e-3)


@settings(max_examples=examples(100), deadline=None)
@given(st.floats(0.01, 5.0), ACCEL, JERK)
def test_a_change_of_speed_is_complete_after_its_time(change: float, accel: float, jerk: float) -> None:
    total_s = ramp_s(change, accel, jerk)
    metres, speed, end_accel = ramp(total_s, change, accel, jerk)
    assert math.isclose(metres, 0.5 * change * total_s, rel_tol=1e-6)
    assert math.isclose(speed, change, rel_tol=1e-6)
    assert abs(end_accel) < 1e-6
