"""Compiled speed and turn-rate controllers, from a wish to motor outputs (behaviour of AR_AttitudeControl, AP_MotorsUGV)."""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.control import GROUND_STEERING, LOOP_S
from sitl.shaping import limited

GRAVITY_M_S2 = 9.80665
MEMORY_TICKS = 10
"""A controller that has not run for 0.2 s starts anew."""
STOPPED_TICKS = 15
"""Having stopped is remembered for 0.3 s."""
STEER_SPEED_MIN_M_S = 1.0
"""Below this speed a lateral acceleration is turned into a turn rate as if at this speed."""


@njit(cache=True, nogil=True)
def filter_share(cutoff_hz: float) -> float:
    """Weight of a new value in a first-order low-pass at the loop's rate; no cutoff lets everything through."""
    if cutoff_hz <= 0.0:
        return 1.0
    return LOOP_S / (LOOP_S + 1.0 / (2.0 * math.pi * cutoff_hz))


@njit(cache=True, nogil=True)
def forward_speed(estimate: Any) -> float:
    """Estimated speed along the rover's own axis."""
    ahead_m_s: float = estimate.vel_n * math.cos(estimate.heading_rad)
    return ahead_m_s + float(estimate.vel_e * math.sin(estimate.heading_rad))


@njit(cache=True, nogil=True)
def accel_limited(control: Any, tuning: Any, speed: float) -> float:
    """The wished speed, no farther from the last one than acceleration or deceleration allow in one loop."""
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
    """The integral one loop later; while the output is saturated it may only shrink."""
    if saturated == 0 or (integral > 0.0 and error < 0.0) or (integral < 0.0 and error > 0.0):
        return limited(integral + error * gain * LOOP_S, limit)
    return integral


@njit(cache=True, nogil=True)
def run_speed(control: Any, tuning: Any, estimate: Any, speed: float) -> None:
    """Set the throttle for a wished speed."""
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
    error = control.desired_speed - actual
    if control.speed_error_fresh:
        control.speed_error = error
        control.speed_error_fresh = 0
    else:
        control.speed_error += filter_share(tuning.speed_filter_hz) * (error - control.speed_error)
    control.speed_integral = integrated(
        control.speed_integral, control.speed_error, tuning.speed_i, tuning.speed_imax, control.throttle_limited
    )
    control.throttle = control.speed_error * tuning.speed_p + control.speed_integral + base


@njit(cache=True, nogil=True)
def run_stop(control: Any, tuning: Any, estimate: Any) -> None:
    """Brake to a stop, then let the motors rest."""
    stopped = control.tick - control.stop_tick < STOPPED_TICKS
    wish = accel_limited(control, tuning, 0.0)
    if wish == 0.0 and abs(forward_speed(estimate)) <= tuning.stop_speed:
        stopped = True
    if stopped:
        control.stop_tick = control.tick
        control.speed_tick = control.tick
        control.speed_error_fresh = 1
        control.speed_integral = 0.0
        control.desired_speed = 0.0
        control.throttle = 0.0
        return
    run_speed(control, tuning, estimate, wish)


@njit(cache=True, nogil=True)
def rate_to_heading(tuning: Any, estimate: Any, heading_rad: float, rate_max: float) -> float:
    """Turn rate that brings the rover to a heading and can still be stopped there; no limit if ``rate_max`` is 0."""
    error = (heading_rad - estimate.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    rate: float = tuning.steer_angle_p * error
    if rate_max > 0.0:
        rate = limited(rate, rate_max)
    if tuning.steer_accel_deg > 0.0:
        rate = limited(rate, math.sqrt(2.0 * abs(error) * math.radians(tuning.steer_accel_deg)))
    return rate


@njit(cache=True, nogil=True)
def run_steering(control: Any, tuning: Any, estimate: Any, rate: float) -> None:
    """Set the steering output for a wished turn rate, limited in rate, acceleration and lateral force."""
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
    error = rate - estimate.yaw_rate_rad_s
    if control.steer_error_fresh:
        control.steer_error = error
        control.steer_error_fresh = 0
    else:
        control.steer_error += filter_share(tuning.steer_filter_hz) * (error - control.steer_error)
    saturated = 1 if control.left_limited or control.right_limited else 0
    control.steer_integral = integrated(
        control.steer_integral, control.steer_error, tuning.steer_i, tuning.steer_imax, saturated
    )
    control.steering = control.steer_error * tuning.steer_p + control.steer_integral + rate * tuning.steer_ff


@njit(cache=True, nogil=True)
def has_steered_wheels(tuning: Any) -> bool:
    """Whether the servo outputs are those of a rover with Ackermann steering, which cannot turn on the spot."""
    return bool(tuning.steering_function == GROUND_STEERING)


@njit(cache=True, nogil=True)
def run_wheels(control: Any, tuning: Any, speed: float, throttle: float, steering: float) -> None:
    """Outputs for steered wheels: the faster, the less steering; the other way round when rolling backwards.

    Up to MOT_SPD_SCA_BASE steering is not scaled, and counts as limited, so that its integral does not wind up.
    """
    fast = tuning.steering_base_m_s > 0.0 and abs(speed) > tuning.steering_base_m_s
    control.left_limited = 1 if not fast or steering <= -1.0 else 0
    control.right_limited = 1 if not fast or steering >= 1.0 else 0
    control.throttle_limited = 1 if abs(throttle) >= 1.0 else 0
    control.throttle_before = throttle
    if fast:
        steering *= tuning.steering_base_m_s / abs(speed)
    control.servo_1 = -steering if speed < 0.0 else steering
    control.servo_3 = throttle


@njit(cache=True, nogil=True)
def run_motors(control: Any, tuning: Any, estimate: Any) -> None:
    """Mix throttle and steering to the two sides; what does not fit is scaled down evenly."""
    throttle = control.throttle
    if tuning.slew_rate > 0.0:
        change = max(tuning.slew_rate * LOOP_S, 1.0) * 0.01
        throttle = control.throttle_before + limited(throttle - control.throttle_before, change)
    throttle = limited(throttle, 1.0)
    steering = limited(control.steering, 1.0)
    if not control.armed:
        control.servo_1 = control.servo_3 = control.throttle_before = 0.0
        control.left_limited = control.right_limited = control.throttle_limited = 1
        return
    if has_steered_wheels(tuning):
        run_wheels(control, tuning, forward_speed(estimate), throttle, steering)
        return
    # The firmware lets a rover turn on the spot, but not faster than its throttle leaves room for.
    total = abs(throttle) + abs(steering)
    scale = 1.0 / total if total > 1.0 else 1.0
    control.left_limited = 1 if steering < 0.0 and (scale < 1.0 or steering <= -1.0) else 0
    control.right_limited = 1 if steering > 0.0 and (scale < 1.0 or steering >= 1.0) else 0
    control.throttle_limited = 1 if scale < 1.0 or abs(throttle) >= 1.0 else 0
    control.throttle_before = throttle
    control.servo_1 = scale * (throttle + steering)
    control.servo_3 = scale * (throttle - steering)
