"""Compiled guided motion: to a place, along a heading, with a turn rate (behaviour of ModeGuided, AR_WPNav, AR_PosControl).

A position target is shaped: an inner target runs ahead of the rover with limited speed, acceleration and jerk, and
the rover is steered after it. A target farther to the side than WP_PIVOT_ANGLE is first faced on the spot; a rover with steered
wheels cannot, and drives an arc.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control import COAST, HEADING, LOOP_S, NEVER, TURN_RATE, WAYPOINT
from sitl.autopilot.motors import has_steered_wheels, run_motors
from sitl.autopilot.shaping import approach_rate, approach_vector, limited, shaped_accel, shortened
from sitl.autopilot.speed import (
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

ACTIVE_TICKS = 5
"""Navigation that has not run for 0.1 s begins anew."""
PIVOT_ACCURACY_RAD = math.radians(5.0)
ARRIVED_M = 0.01
"""The inner target must have come this near to the destination before a target counts as reached."""
SPEED_CHANGE_TICKS = 25
"""Changes of the top speed are taken over no more often than every 0.5 s."""
UNLIMITED_ACCEL_M_S2 = 20.0
AVOID_PROXIMITY = 2
"""Bit of AVOID_ENABLE: slow down for what proximity sensors see, with half the deceleration."""
PLAN_FROM_REST = 64
"""Bit of GUID_OPTIONS: every target is planned anew from standstill, so that quick repeats keep the rover standing."""


@njit(cache=True, nogil=True)
def begin_guided(control: Any, tuning: Any) -> None:
    """Enter GUIDED: no target, speed and acceleration limits from the parameters."""
    slowest = tuning.accel_max
    if tuning.decel_max > 0.0:
        slowest = min(slowest, tuning.decel_max)
    if slowest <= 0.0:
        slowest = UNLIMITED_ACCEL_M_S2
    control.base_speed = control.speed_max = max(tuning.wp_speed, 0.05)
    control.accel_max = min(tuning.wp_accel, slowest) if tuning.wp_accel > 0.0 else slowest
    control.jerk_max = tuning.wp_jerk if tuning.wp_jerk > 0.0 else control.accel_max
    control.pivoting = 0
    control.reached = 0
    control.have_target = 0
    control.reversed = 0


@njit(cache=True, nogil=True)
def bearing_to_target(control: Any, estimate: Any) -> float:
    """Heading that the rover needs to drive to the target, tail first when reversed."""
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
    """Put the inner target where the rover is, moving as it moves."""
    control.shaped_n, control.shaped_e = estimate.north_m, estimate.east_m
    control.shaped_vn, control.shaped_ve = estimate.vel_n, estimate.vel_e
    control.shaped_an, control.shaped_ae = estimate.accel_n, estimate.accel_e


@njit(cache=True, nogil=True)
def begin_target(control: Any, tuning: Any, estimate: Any, north_m: float, east_m: float) -> None:
    """Take a new position target, metres from the EKF origin."""
    control.dest_n = north_m
    control.dest_e = east_m
    control.reached = 0
    control.arrived = 0
    control.fresh_target = 1
    control.task = WAYPOINT
    if int(tuning.guided_options) & PLAN_FROM_REST:
        restart_shaping(control, estimate)
        control.shaped_vn = control.shaped_ve = control.shaped_an = control.shaped_ae = 0.0
    check_pivot(control, tuning, estimate)


@njit(cache=True, nogil=True)
def shape_target(control: Any, tuning: Any, estimate: Any) -> None:
    """Move the inner target one loop on, and see whether the rover has arrived."""
    if control.tick - control.place_tick >= ACTIVE_TICKS:
        restart_shaping(control, estimate)
    control.shaped_n += control.shaped_vn * LOOP_S + 0.5 * control.shaped_an * LOOP_S * LOOP_S
    control.shaped_e += control.shaped_ve * LOOP_S + 0.5 * control.shaped_ae * LOOP_S * LOOP_S
    control.shaped_vn += control.shaped_an * LOOP_S
    control.shaped_ve += control.shaped_ae * LOOP_S
    accel_max = min(control.accel_max, tuning.turn_max_g * GRAVITY_M_S2)
    control.shaped_an, control.shaped_ae = shaped_accel(
        control.dest_n - control.shaped_n, control.dest_e - control.shaped_e,
        control.shaped_vn, control.shaped_ve, control.shaped_an, control.shaped_ae,
        control.speed_max, accel_max, control.jerk_max, LOOP_S,
    )  # fmt: skip
    control.place_valid = 1
    if not control.reached:
        left = math.hypot(control.dest_n - control.shaped_n, control.dest_e - control.shaped_e)
        behind = math.hypot(control.shaped_n - estimate.north_m, control.shaped_e - estimate.east_m)
        control.reached = 1 if left < ARRIVED_M and behind < tuning.wp_radius else 0


@njit(cache=True, nogil=True)
def error_limit(speed_max: float, gain: float, accel: float) -> float:
    """The position error at which the approach reaches the top speed."""
    linear_speed = accel / gain
    if speed_max <= linear_speed:
        return speed_max / gain
    return 0.5 * (accel / (gain * gain) + speed_max * speed_max / accel)


@njit(cache=True, nogil=True)
def turn_speed(tuning: Any) -> float:
    """The speed at which a turn of TURN_RADIUS takes half the lateral acceleration that is allowed."""
    return math.sqrt(max(0.5 * tuning.turn_max_g * GRAVITY_M_S2 * tuning.turn_radius_m, 0.0))


@njit(cache=True, nogil=True)
def follow_shaped(control: Any, tuning: Any, estimate: Any) -> None:
    """Speed and turn rate that keep the rover with the inner target."""
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
    # Who cannot turn on the spot must keep rolling to come round to a target that is not ahead.
    rolling = min(math.hypot(goal_n, goal_e), turn_speed(tuning)) if has_steered_wheels(tuning) else 0.0
    speed = min(-rolling, speed) if control.reversed else max(rolling, speed)
    control.nav_speed = accel_limited(control, tuning, speed)
    control.nav_turn_rate = rate_of_lateral(accel_e * ahead_n - accel_n * ahead_e, control.nav_speed)


@njit(cache=True, nogil=True)
def run_waypoint(control: Any, tuning: Any, estimate: Any) -> None:
    """One loop of driving to the position target."""
    if control.armed:
        control.nav_tick = control.tick
        if control.base_speed != control.speed_max and control.tick - control.speed_change_tick >= SPEED_CHANGE_TICKS:
            control.speed_change_tick = control.tick
            control.speed_max = control.base_speed
        if not control.pivoting:
            shape_target(control, tuning, estimate)
        follow_shaped(control, tuning, estimate)
    steer_waypoint(control, tuning, estimate)


@njit(cache=True, nogil=True)
def steer_waypoint(control: Any, tuning: Any, estimate: Any) -> None:
    """Throttle and steering after the inner target, or for turning on the spot."""
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
    """Throttle for a wished speed; a wish of zero is a controlled stop."""
    speed = accel_limited(control, tuning, speed)
    if int(tuning.avoid) & AVOID_PROXIMITY and speed > 0.0:
        room_m = max(control.room_m - tuning.avoid_margin_m, 0.0)
        speed = min(speed, math.sqrt(tuning.accel_max * room_m))
    if speed == 0.0:
        run_stop(control, tuning, estimate)
    else:
        run_speed(control, tuning, estimate, speed)


@njit(cache=True, nogil=True)
def run_heading_or_rate(control: Any, tuning: Any, estimate: Any) -> None:
    """One loop of holding a heading or turn rate at a speed; stops when no new target comes in time."""
    elapsed_s = (control.tick - control.target_tick) * LOOP_S
    if control.have_target and elapsed_s > max(tuning.guided_timeout_s, 0.1):
        control.have_target = 0
        control.timed_out = 1
    if not control.have_target:
        run_stop(control, tuning, estimate)
        control.steering = 0.0
        return
    rate = control.target_turn_rate
    if control.task == HEADING:
        rate = rate_to_heading(tuning, estimate, control.target_heading, 0.0)
    run_steering(control, tuning, estimate, rate)
    run_throttle(control, tuning, estimate, control.target_speed)


@njit(cache=True, nogil=True)
def run_control(control: Any, tuning: Any, estimate: Any) -> None:
    """One main loop: from the task to motor outputs."""
    if control.task == WAYPOINT and not control.reached:
        run_waypoint(control, tuning, estimate)
    elif control.task in (HEADING, TURN_RATE):
        run_heading_or_rate(control, tuning, estimate)
    elif control.task == COAST:
        control.throttle, control.steering = control.stick_throttle, control.stick_steering
    else:
        if control.task == WAYPOINT and control.fresh_target:
            control.fresh_target = 0
            control.arrived = 1
        run_stop(control, tuning, estimate)
        control.steering = 0.0
    run_motors(control, tuning, estimate)


__all__ = ["approach_rate", "begin_guided", "begin_target", "run_control"]
