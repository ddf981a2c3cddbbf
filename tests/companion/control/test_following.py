"""How the rover follows velocities, as settings and parameters tell."""

from __future__ import annotations

import math

import pytest

from companion.control.following import AS_SHIPPED, alone_s, following_of, turn_gains, within_limits
from companion.core.rover_limits import RoverLimits
from companion.settings import MotionSettings

ROVER = RoverLimits(0.4, 2.0, 8.0)


def test_without_settings_and_parameters_it_is_as_shipped() -> None:
    assert following_of(MotionSettings(), {}) == AS_SHIPPED


def test_the_limits_are_the_autopilots() -> None:
    follows = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 1.5, "ATC_DECEL_MAX": 1.8, "ATC_STR_ACC_MAX": 90.0})
    assert follows[1:3] == (1.5, 1.8) and follows.gains_most_m_s2 == pytest.approx(1.5 * 1.3)
    assert follows.turn_acceleration_rad_s2 == pytest.approx(math.pi / 2.0)


def test_braking_without_a_limit_of_its_own_has_that_of_gaining_speed() -> None:
    assert following_of(MotionSettings(), {"ATC_ACCEL_MAX": 2.0, "ATC_DECEL_MAX": 0.0}).deceleration_m_s2 == 2.0


def test_an_autopilot_without_limits_makes_no_rover_brake_better() -> None:
    """It may gather speed as fast as motors can, but it is counted on to brake as one with the limits as shipped."""
    follows = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 0.0, "ATC_DECEL_MAX": 0.0, "ATC_STR_ACC_MAX": 0.0})
    assert follows[1:3] == (1.0, 1.0) and follows.gains_most_m_s2 == pytest.approx(13.0)
    assert follows.turn_acceleration_rad_s2 == AS_SHIPPED.turn_acceleration_rad_s2
    large = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 20.0, "ATC_DECEL_MAX": 5.0, "ATC_STR_ACC_MAX": 900.0})
    assert large.turn_acceleration_rad_s2 == pytest.approx(4.0)
    assert large[1:3] == (2.0, 2.0) and large.gains_most_m_s2 == pytest.approx(13.0)


def test_what_is_set_counts_before_what_the_autopilot_says() -> None:
    own = MotionSettings(acceleration_m_s2=0.5, deceleration_m_s2=0.6, turn_acceleration_rad_s2=0.7)
    follows = following_of(own, {"ATC_ACCEL_MAX": 2.0, "ATC_DECEL_MAX": 3.0, "ATC_STR_ACC_MAX": 90.0})
    assert follows[1:4] == (0.5, 0.6, 0.7)


def test_what_the_autopilot_would_cut_short_is_a_limit() -> None:
    limited = within_limits(ROVER, {"WP_SPEED": 1.2, "CRUISE_SPEED": 0.5, "ATC_STR_RAT_MAX": 45.0})
    assert limited.told_most_m_s == 1.2 and limited.turns_most_rad_s == pytest.approx(0.25 * math.pi)
    assert limited.cruise_speed_m_s == ROVER.cruise_speed_m_s
    assert within_limits(ROVER, {"WP_SPEED": 0.0, "CRUISE_SPEED": 0.5}).told_most_m_s == 0.5


def test_limits_that_are_not_known_or_zero_change_nothing() -> None:
    zero = {"WP_SPEED": 0.0, "CRUISE_SPEED": 0.0, "ATC_STR_RAT_MAX": 0.0}
    assert within_limits(ROVER, {}) == within_limits(ROVER, zero) == ROVER


def test_the_longer_a_velocity_lasts_the_more_the_rover_is_left_alone() -> None:
    """With a guard as it ships not at all; so that no limit lies between a guard of 0.9 s and a timeout of 1 s."""
    lasts_s = [0.1, 0.35, 0.5, 0.9, 1.0, 1.2, 3.0, 10.0]
    left_s = [alone_s(one) for one in lasts_s]
    assert left_s == sorted(left_s) and left_s[:3] == [0.0] * 3 and left_s[3] > 0.0
    assert left_s[-2:] == [2.0, 9.0]
    most = [max(turn_gains(AS_SHIPPED, one)) for one in lasts_s]
    assert most == sorted(most) and most[0] == 1.0 + AS_SHIPPED.off_model
    assert most[-2:] == pytest.approx([1.4 + AS_SHIPPED.off_model - 0.3] * 2)
