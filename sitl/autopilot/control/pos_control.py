"""Follows a moving inner target, after a turn on the spot if needed (AR_PosControl, AR_PivotTurn; compiled).

Nouns: AR_PosControl, AR_PivotTurn.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import (
    GRAVITY_M_S2,
    accel_limited,
    filter_share,
    forward_speed,
    rate_of_lateral,
    rate_to_heading,
    run_speed,
    run_steering,
    run_stop,
)
from sitl.autopilot.control.motors import has_steered_wheels
from sitl.autopilot.control.records import LOOP_S, NEVER
from sitl.autopilot.control.shaping import approach_vector, limited, shortened

ACTIVE_TICKS = 5
"""Navigation that has not run for 0.1 s is reset."""

PIVOT_ACCURACY_RAD = math.radians(5.0)

SPEED_CHANGE_TICKS = 25
"""Changes of the top speed take effect at most every 0.5 s."""

AVOID_PROXIMITY = 2
"""Bit of AVOID_ENABLE: slow down for what proximity sensors see, with half the deceleration."""


@njit(cache=True, nogil=True)
def bearing_to_target(control: Any, estimate: Any) -> float:
    """Heading for driving straight to the target, or for reversing to it."""
    bearing = math.atan2(control.dest_e - estimate.east_m, control.dest_n - estimate.north_m)
    return bearing + math.pi if control.reversed else bearing


@njit(cache=True, nogil=True)
def check_pivot(control: Any, tuning: Any, estimate: Any) -> None:
    """Begin or end turning on the spot."""
    limit = math.radians(tuning.pivot_angle_deg)
    if limit <= PIVOT_ACCURACY_RAD or has_steered_wheels(tuning):
        control.pivoting = 0
        return
    error = bearing_to_target(control, estimate) - estimate.heading_rad
    error = abs((error + math.pi) % (2.0 * math.pi) - math.pi)
    if error > limit:
        control.pivoting = 1
        control.pivot_done_tick = NEVER
        return
    if control.pivoting and error < PIVOT_ACCURACY_RAD and control.pivot_done_tick == NEVER:
        control.pivot_done_tick = control.tick
    if control.pivot_done_tick != NEVER and (control.tick - control.pivot_done_tick) * LOOP_S >= tuning.pivot_delay_s:
        control.pivoting = 0
        control.pivot_done_tick = NEVER


@njit(cache=True, nogil=True)
def restart_shaping(control: Any, estimate: Any) -> None:
    """Put the inner target at the rover's position, with its velocity and acceleration."""
    control.shaped_n, control.shaped_e = estimate.north_m, estimate.east_m
    control.shaped_vn, control.shaped_ve = estimate.vel_n, estimate.vel_e
    control.shaped_an, control.shaped_ae = estimate.accel_n, estimate.accel_e


@njit(cache=True, nogil=True)
def error_limit(speed_max: float, gain: float, accel: float) -> float:
    """Position error in metres at which the approach reaches the top speed."""
    linear_speed = accel / gain
    if speed_max <= linear_speed:
        return speed_max / gain
    return 0.5 * (accel / (gain * gain) + speed_max * speed_max / accel)


@njit(cache=True, nogil=True)
def turn_speed(tuning: Any) -> float:
    """The speed at which a turn of TURN_RADIUS needs half of the permitted lateral acceleration."""
    return math.sqrt(max(0.5 * tuning.turn_max_g * GRAVITY_M_S2 * tuning.turn_radius_m, 0.0))


@njit(cache=True, nogil=True)
def follow_shaped(control: Any, tuning: Any, estimate: Any) -> None:
    """Set speed and turn rate that follow the inner target."""
    if control.tick - control.place_tick >= ACTIVE_TICKS:
        control.vel_error_fresh = 1
    control.place_tick = control.tick
    goal_n = goal_e = feed_n = feed_e = 0.0
    if control.place_valid:
        accel = min(control.accel_max, tuning.turn_max_g * GRAVITY_M_S2, control.jerk_max / tuning.pos_p)
        error_n, error_e = shortened(
            control.shaped_n - estimate.north_m,
            control.shaped_e - estimate.east_m,
            error_limit(control.speed_max, tuning.pos_p, accel),
        )
        goal_n, goal_e = approach_vector(error_n, error_e, tuning.pos_p, accel, 0.0)
        goal_n += control.shaped_vn
        goal_e += control.shaped_ve
        feed_n, feed_e = control.shaped_an, control.shaped_ae
    goal_n, goal_e = shortened(goal_n, goal_e, control.speed_max)
    share = 1.0 if control.vel_error_fresh else filter_share(tuning.vel_filter_hz)
    control.vel_error_fresh = 0
    control.vel_error_n += share * (goal_n - estimate.vel_n - control.vel_error_n)
    control.vel_error_e += share * (goal_e - estimate.vel_e - control.vel_error_e)
    accel_n = control.vel_error_n * tuning.vel_p + feed_n
    accel_e = control.vel_error_e * tuning.vel_p + feed_e
    ahead_n, ahead_e = math.cos(estimate.heading_rad), math.sin(estimate.heading_rad)
    speed = goal_n * ahead_n + goal_e * ahead_e
    # A rover with steered wheels must keep rolling to turn towards a target that is not ahead.
    rolling = min(math.hypot(goal_n, goal_e), turn_speed(tuning)) if has_steered_wheels(tuning) else 0.0
    speed = min(-rolling, speed) if control.reversed else max(rolling, speed)
    control.nav_speed = accel_limited(control, tuning, speed)
    control.nav_turn_rate = rate_of_lateral(accel_e * ahead_n - accel_n * ahead_e, control.nav_speed)


@njit(cache=True, nogil=True)
def steer_waypoint(control: Any, tuning: Any, estimate: Any) -> None:
    """Set throttle and steering for following the inner target or for turning on the spot."""
    if control.armed:
        if control.pivoting:
            control.nav_speed = accel_limited(control, tuning, 0.0)
            control.nav_turn_rate = 0.0
            if control.nav_speed == 0.0:
                rate_max = math.radians(tuning.pivot_rate_deg)
                bearing = bearing_to_target(control, estimate)
                control.nav_turn_rate = rate_to_heading(tuning, estimate, bearing, rate_max)
                check_pivot(control, tuning, estimate)
    else:
        control.nav_speed = accel_limited(control, tuning, 0.0)
        control.nav_turn_rate = 0.0
    run_throttle(control, tuning, estimate, control.nav_speed)
    side = abs(rate_of_lateral(tuning.turn_max_g * GRAVITY_M_S2, forward_speed(estimate)))
    rate = limited(control.nav_turn_rate, side) if tuning.turn_max_g > 0.0 else control.nav_turn_rate
    run_steering(control, tuning, estimate, rate)


@njit(cache=True, nogil=True)
def run_throttle(control: Any, tuning: Any, estimate: Any, speed: float) -> None:
    """Set the throttle for a desired speed; a speed of zero is a controlled stop."""
    speed = accel_limited(control, tuning, speed)
    if int(tuning.avoid) & AVOID_PROXIMITY and speed > 0.0:
        room_m = max(control.room_m - tuning.avoid_margin_m, 0.0)
        speed = min(speed, math.sqrt(tuning.accel_max * room_m))
    if speed == 0.0:
        run_stop(control, tuning, estimate)
    else:
        run_speed(control, tuning, estimate, speed)
