"""How the rover follows velocities, as settings and parameters tell."""

from __future__ import annotations

import math

import pytest

from companion.control.following import AS_SHIPPED, following_of
from companion.settings import MotionSettings


def test_without_settings_and_parameters_it_is_as_shipped() -> None:
    assert following_of(MotionSettings(), {}) == AS_SHIPPED


def test_the_limits_are_the_autopilots() -> None:
    follows = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 2.0, "ATC_DECEL_MAX": 3.0, "ATC_STR_ACC_MAX": 90.0})
    assert follows[1:3] == (2.0, 3.0)
    assert follows.turn_acceleration_rad_s2 == pytest.approx(math.pi / 2.0)


def test_braking_without_a_limit_of_its_own_has_that_of_gaining_speed() -> None:
    assert following_of(MotionSettings(), {"ATC_ACCEL_MAX": 2.0, "ATC_DECEL_MAX": 0.0}).deceleration_m_s2 == 2.0


def test_no_limit_is_a_large_one() -> None:
    follows = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 0.0, "ATC_STR_ACC_MAX": 0.0})
    assert follows.acceleration_m_s2 == 10.0 and follows.turn_acceleration_rad_s2 == pytest.approx(20.0)


def test_what_is_set_counts_before_what_the_autopilot_says() -> None:
    own = MotionSettings(acceleration_m_s2=0.5, deceleration_m_s2=0.6, turn_acceleration_rad_s2=0.7)
    follows = following_of(own, {"ATC_ACCEL_MAX": 2.0, "ATC_DECEL_MAX": 3.0, "ATC_STR_ACC_MAX": 90.0})
    assert follows[1:4] == (0.5, 0.6, 0.7)
