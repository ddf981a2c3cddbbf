"""Speed and turn-rate controllers that set throttle and steering (AR_AttitudeControl, AC_PID; compiled).

Nouns: AR_AttitudeControl, AC_PID.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.records import LOOP_S
from sitl.autopilot.control.shaping import limited

GRAVITY_M_S2 = 9.80665

MEMORY_TICKS = 10
"""A controller that has not run for 0.2 s is reset."""

STOPPED_TICKS = 15
"""A stop is remembered for 0.3 s."""

STEER_SPEED_MIN_M_S = 1.0
"""At lower speeds a lateral acceleration is converted to a turn rate as if at this speed."""


@njit(cache=True, nogil=True)
def filter_share(cutoff_hz: float) -> float:
    """Weight of a new value in a first-order low-pass at the loop's rate; 1 without a cutoff."""
    if cutoff_hz <= 0.0:
        return 1.0
    return LOOP_S / (LOOP_S + 1.0 / (2.0 * math.pi * cutoff_hz))


@njit(cache=True, nogil=True)
def forward_speed(estimate: Any) -> float:
    """Estimated forward speed."""
    ahead_m_s: float = estimate.vel_n * math.cos(estimate.heading_rad)
    return ahead_m_s + float(estimate.vel_e * math.sin(estimate.heading_rad))


@njit(cache=True, nogil=True)
def accel_limited(control: Any, tuning: Any, speed: float) -> float:
    """The desired speed, limited to what acceleration or deceleration allow in one loop."""
    if control.tick - control.speed_tick > MEMORY_TICKS or tuning.accel_max <= 0.0:
        return speed
    change = tuning.accel_max
    if abs(speed) < abs(control.desired_speed) and tuning.decel_max > 0.0:
        change = tuning.decel_max
    return float(control.desired_speed) + limited(speed - control.desired_speed, change * LOOP_S)


@njit(cache=True, nogil=True)
def rate_of_lateral(accel: float, speed: float) -> float:
    """Turn rate for a lateral acceleration at a speed."""
    if abs(speed) < STEER_SPEED_MIN_M_S:
        speed = -STEER_SPEED_MIN_M_S if speed < 0.0 else STEER_SPEED_MIN_M_S
    return accel / speed


@njit(cache=True, nogil=True)
def integrated(integral: float, error: float, gain: float, limit: float, saturated: int) -> float:
    """The integral one loop later; while the output is saturated it can only shrink."""
    if saturated == 0 or (integral > 0.0 and error < 0.0) or (integral < 0.0 and error > 0.0):
        return limited(integral + error * gain * LOOP_S, limit)
    return integral


@njit(cache=True, nogil=True)
def filtered(
    before: tuple[float, float, float], target: float, actual: float, fresh: int,
    target_hz: float, error_hz: float, slope_hz: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Target, error and slope of the error, each low-passed (AC_PID: FLTT, FLTE, FLTD); ``before``: a loop ago."""
    if fresh:
        return target, target - actual, 0.0
    if target_hz > 0.0:
        target = before[0] + filter_share(target_hz) * (target - before[0])
    error = before[1] + filter_share(error_hz) * (target - actual - before[1])
    slope = before[2] + filter_share(slope_hz) * ((error - before[1]) / LOOP_S - before[2])
    return target, error, slope


@njit(cache=True, nogil=True)
def run_speed(control: Any, tuning: Any, estimate: Any, speed: float) -> None:
    """Set the throttle for a desired speed."""
    actual = forward_speed(estimate)
    if control.tick - control.speed_tick > MEMORY_TICKS:
        control.speed_error_fresh = 1
        control.speed_integral = 0.0
        control.desired_speed = actual
    control.speed_tick = control.tick
    control.desired_speed = accel_limited(control, tuning, speed)
    base = 0.0
    if tuning.cruise_speed > 0.0 and tuning.cruise_throttle > 0.0:
        base = control.desired_speed * tuning.cruise_throttle * 0.01 / tuning.cruise_speed
    control.speed_target, control.speed_error, control.speed_slope = filtered(
        (control.speed_target, control.speed_error, control.speed_slope), control.desired_speed, actual,
        control.speed_error_fresh, tuning.speed_target_hz, tuning.speed_filter_hz, tuning.speed_slope_hz,
    )  # fmt: skip
    control.speed_error_fresh = 0
    saturated = 1 if control.throttle_limited or control.throttle_withheld else 0
    control.speed_integral = integrated(
        control.speed_integral, control.speed_error, tuning.speed_i, tuning.speed_imax, saturated
    )
    throttle = control.speed_error * tuning.speed_p + control.speed_integral + base
    throttle += control.speed_slope * tuning.speed_d + control.speed_target * tuning.speed_ff
    # Without ATC_BRAKE the motors never push against the desired direction of travel.
    against = throttle <= 0.0 if control.desired_speed >= 0.0 else throttle >= 0.0
    control.throttle_withheld = 1 if tuning.brake == 0.0 and against else 0
    control.throttle = 0.0 if control.throttle_withheld else throttle


@njit(cache=True, nogil=True)
def run_stop(control: Any, tuning: Any, estimate: Any) -> None:
    """Brake to a stop, then switch the throttle off."""
    stopped = control.tick - control.stop_tick < STOPPED_TICKS
    desired = accel_limited(control, tuning, 0.0)
    if desired == 0.0 and abs(forward_speed(estimate)) <= tuning.stop_speed:
        stopped = True
    if stopped:
        control.stop_tick = control.tick
        control.speed_tick = control.tick
        control.speed_error_fresh = 1
        control.speed_integral = 0.0
        control.desired_speed = 0.0
        control.throttle = 0.0
        return
    run_speed(control, tuning, estimate, desired)


@njit(cache=True, nogil=True)
def rate_to_heading(tuning: Any, estimate: Any, heading_rad: float, rate_max: float) -> float:
    """Turn rate that leads to a heading and still allows to stop there; unlimited if ``rate_max`` is 0."""
    error = (heading_rad - estimate.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    rate: float = tuning.steer_angle_p * error
    if rate_max > 0.0:
        rate = limited(rate, rate_max)
    if tuning.steer_accel_deg > 0.0:
        rate = limited(rate, math.sqrt(2.0 * abs(error) * math.radians(tuning.steer_accel_deg)))
    return rate


@njit(cache=True, nogil=True)
def run_steering(control: Any, tuning: Any, estimate: Any, rate: float) -> None:
    """Set the steering for a desired turn rate, with limited rate, angular and lateral acceleration."""
    if control.tick - control.steer_tick > MEMORY_TICKS:
        control.steer_error_fresh = 1
        control.steer_integral = 0.0
        control.desired_turn_rate = estimate.yaw_rate_rad_s
    control.steer_tick = control.tick
    if tuning.steer_accel_deg > 0.0:
        change = math.radians(tuning.steer_accel_deg) * LOOP_S
        rate = control.desired_turn_rate + limited(rate - control.desired_turn_rate, change)
    if tuning.steer_rate_deg > 0.0:
        rate = limited(rate, math.radians(tuning.steer_rate_deg))
    side = rate_of_lateral(tuning.turn_max_g * GRAVITY_M_S2, abs(forward_speed(estimate)))
    rate = limited(rate, max(side, math.radians(1.0)))
    control.desired_turn_rate = rate
    control.steer_target, control.steer_error, control.steer_slope = filtered(
        (control.steer_target, control.steer_error, control.steer_slope), rate, estimate.yaw_rate_rad_s,
        control.steer_error_fresh, tuning.steer_target_hz, tuning.steer_filter_hz, tuning.steer_slope_hz,
    )  # fmt: skip
    control.steer_error_fresh = 0
    saturated = 1 if control.left_limited or control.right_limited else 0
    control.steer_integral = integrated(
        control.steer_integral, control.steer_error, tuning.steer_i, tuning.steer_imax, saturated
    )
    steering = control.steer_error * tuning.steer_p + control.steer_integral + control.steer_target * tuning.steer_ff
    control.steering = steering + control.steer_slope * tuning.steer_d
