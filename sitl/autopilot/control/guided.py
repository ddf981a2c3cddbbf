"""Guided motion: to a position target, along a heading, with a turn rate (behaviour of ModeGuided; compiled).

A position target is shaped: an inner target runs ahead of the rover with limited speed, acceleration and jerk, and
the rover follows it. If the target lies farther to the side than WP_PIVOT_ANGLE, the rover first turns on the spot;
with steered wheels it drives an arc instead.

Nouns: guided motion.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import (
    GRAVITY_M_S2,
    rate_to_heading,
    run_steering,
    run_stop,
)
from sitl.autopilot.control.pos_control import (
    ACTIVE_TICKS,
    SPEED_CHANGE_TICKS,
    check_pivot,
    follow_shaped,
    restart_shaping,
    run_throttle,
    steer_waypoint,
)
from sitl.autopilot.control.records import HEADING, LOOP_S, WAYPOINT
from sitl.autopilot.control.shaping import ShapingLimits, shaped_accel

ARRIVED_M = 0.01
"""The target counts as reached only when the inner target is this near to it."""

UNLIMITED_ACCEL_M_S2 = 20.0

PLAN_FROM_REST = 64
"""Bit of GUID_OPTIONS: every target is planned from standstill, so that frequent targets keep the rover from moving."""


@njit(cache=True, nogil=True)
def begin_guided(control: Any, tuning: Any) -> None:
    """Begin without a target, with the speed, acceleration and jerk limits of the parameters."""
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
    """Move the inner target on by one loop, and check whether the rover has arrived."""
    if control.tick - control.place_tick >= ACTIVE_TICKS:
        restart_shaping(control, estimate)
    control.shaped_n += control.shaped_vn * LOOP_S + 0.5 * control.shaped_an * LOOP_S * LOOP_S
    control.shaped_e += control.shaped_ve * LOOP_S + 0.5 * control.shaped_ae * LOOP_S * LOOP_S
    control.shaped_vn += control.shaped_an * LOOP_S
    control.shaped_ve += control.shaped_ae * LOOP_S
    accel_max = min(control.accel_max, tuning.turn_max_g * GRAVITY_M_S2)
    control.shaped_an, control.shaped_ae = shaped_accel(
        (control.dest_n - control.shaped_n, control.dest_e - control.shaped_e),
        (control.shaped_vn, control.shaped_ve),
        (control.shaped_an, control.shaped_ae),
        ShapingLimits(control.speed_max, accel_max, control.jerk_max),
        LOOP_S,
    )
    control.place_valid = 1
    if not control.reached:
        left = math.hypot(control.dest_n - control.shaped_n, control.dest_e - control.shaped_e)
        behind = math.hypot(control.shaped_n - estimate.north_m, control.shaped_e - estimate.east_m)
        control.reached = 1 if left < ARRIVED_M and behind < tuning.wp_radius else 0


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
def run_heading_or_rate(control: Any, tuning: Any, estimate: Any) -> None:
    """One loop of holding a heading or turn rate at a speed; stops when targets time out (GUID_TIMEOUT)."""
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
