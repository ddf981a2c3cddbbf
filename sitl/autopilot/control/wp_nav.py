"""Driving along straight legs between waypoints, for AUTO, RTL and SMART_RTL (behaviour of AR_WPNav; compiled).

An inner target moves along the leg with limited speed, acceleration and jerk, and no faster than the rover can
follow. Before a corner without a pivot turn, the next leg begins while this one ends, so that the rover rounds the
corner without stopping.

Nouns: AR_WPNav.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import GRAVITY_M_S2, run_stop
from sitl.autopilot.control.motors import has_steered_wheels
from sitl.autopilot.control.pos_control import (
    ACTIVE_TICKS,
    PIVOT_ACCURACY_RAD,
    SPEED_CHANGE_TICKS,
    bearing_to_target,
    check_pivot,
    follow_shaped,
    steer_waypoint,
)
from sitl.autopilot.control.records import LEG, LOOP_S, NEVER
from sitl.autopilot.control.scurve import (
    AHEAD_E,
    AHEAD_N,
    DONE,
    LENGTH,
    SPEED,
    START_SPEED,
    TIME,
    along,
    leg_times,
    ramp_s,
    top_speed,
)
from sitl.autopilot.control.shaping import Vector

BEFORE, THIS, NEXT = 0, 1, 2
"""Rows of ``control.legs``: the previous leg, which may still be ending, the present one, the next one."""

PACE_BUFFER = 0.05


@njit(cache=True, nogil=True)
def lay_leg(control: Any, row: int, from_n: float, from_e: float, to_n: float, to_e: float) -> None:
    """Plan a leg from rest to rest."""
    leg = control.legs[row]
    leg[LENGTH] = math.hypot(to_n - from_n, to_e - from_e)
    leg[START_SPEED] = leg[TIME] = leg[DONE] = 0.0
    leg[SPEED] = leg[AHEAD_N] = leg[AHEAD_E] = 0.0
    if leg[LENGTH] > 0.0:
        leg[AHEAD_N], leg[AHEAD_E] = (to_n - from_n) / leg[LENGTH], (to_e - from_e) / leg[LENGTH]
        leg[SPEED] = top_speed(leg[LENGTH], 0.0, control.speed_max, control.accel_max, control.jerk_max)


@njit(cache=True, nogil=True)
def change_leg_speed(control: Any, row: int) -> None:
    """Replan the rest of a leg for a new top speed, unless it already brakes."""
    leg, accel, jerk = control.legs[row], control.accel_max, control.jerk_max
    done_m, speed, _ = along(leg, leg[TIME], accel, jerk)
    desired = top_speed(leg[LENGTH] - done_m, speed, control.speed_max, accel, jerk)
    if leg[LENGTH] > 0.0 and leg[TIME] < leg_times(leg, accel, jerk)[0] and desired > 0.0:
        leg[START_SPEED], leg[SPEED], leg[DONE], leg[TIME] = speed, desired, done_m, 0.0


@njit(cache=True, nogil=True)
def clear_leg(control: Any, row: int) -> None:
    """No leg."""
    for column in range(7):
        control.legs[row, column] = 0.0


@njit(cache=True, nogil=True)
def begin_leg(control: Any, tuning: Any, estimate: Any, to: Vector, after: Vector, onwards: bool) -> None:
    """Drive to a place (metres from the EKF origin); with ``onwards`` on to ``after`` without stopping there."""
    (to_n, to_e), (after_n, after_e) = to, after
    control.halts = 0
    moving = control.task == LEG and control.tick - control.nav_tick < ACTIVE_TICKS and control.reached
    from_n, from_e = control.dest_n, control.dest_e
    if not moving:
        speed = math.hypot(estimate.vel_n, estimate.vel_e)
        room = 0.5 * speed / max(control.accel_max, 0.01)
        from_n, from_e = estimate.north_m + estimate.vel_n * room, estimate.east_m + estimate.vel_e * room
        control.fast = 0
        control.pace = 1.0
        clear_leg(control, THIS)
        clear_leg(control, NEXT)
    control.legs[BEFORE, :] = control.legs[THIS, :]
    control.dest_n, control.dest_e = to_n, to_e
    control.from_n, control.from_e = from_n, from_e
    control.reached = control.arrived = 0
    control.fresh_target = 1
    control.task = LEG
    if not control.fast:
        control.pivoting = 0
        check_pivot(control, tuning, estimate)
        if control.corner and moving and off_course(control, estimate) > PIVOT_ACCURACY_RAD:
            # The rover stopped here in order to turn.
            control.pivoting = 1
            control.pivot_done_tick = NEVER
    if control.fast and control.legs[NEXT, TIME] > 0.0:
        control.legs[THIS, :] = control.legs[NEXT, :]
    else:
        lay_leg(control, THIS, from_n, from_e, to_n, to_e)
    clear_leg(control, NEXT)
    control.fast = 0
    control.corner = 1 if onwards and turns_on_the_spot(control, tuning, from_n, from_e, after_n, after_e) else 0
    if onwards and not control.corner:
        lay_leg(control, NEXT, to_n, to_e, after_n, after_e)
        control.fast = 1


@njit(cache=True, nogil=True)
def off_course(control: Any, estimate: Any) -> float:
    """Angle between the heading and the direction of the destination, in radians."""
    error = bearing_to_target(control, estimate) - estimate.heading_rad
    return float(abs((error + math.pi) % (2.0 * math.pi) - math.pi))


@njit(cache=True, nogil=True)
def turns_on_the_spot(control: Any, tuning: Any, from_n: float, from_e: float, after_n: float, after_e: float) -> bool:
    """Whether the corner at the end of the leg is sharp enough for a stop and a pivot turn."""
    limit = math.radians(tuning.pivot_angle_deg)
    if limit <= PIVOT_ACCURACY_RAD or has_steered_wheels(tuning):
        return False
    first = math.atan2(control.dest_e - from_e, control.dest_n - from_n)
    second = math.atan2(after_e - control.dest_e, after_n - control.dest_n)
    return abs((second - first + math.pi) % (2.0 * math.pi) - math.pi) > limit


@njit(cache=True, nogil=True)
def may_turn(control: Any, tuning: Any) -> bool:
    """Whether the next leg may begin: within WP_RADIUS of the corner, and within the lateral acceleration."""
    this, after, accel, jerk = control.legs[THIS], control.legs[NEXT], control.accel_max, control.jerk_max
    braking_s, end_s = leg_times(this, accel, jerk)
    next_end_s = leg_times(after, accel, jerk)[1]
    left_s = end_s - this[TIME]
    turn_in_s = max(ramp_s(after[SPEED], accel, jerk) - accel / jerk, 0.0)
    if this[TIME] < braking_s - turn_in_s or along(this, this[TIME], accel, jerk)[0] < 0.5 * this[LENGTH]:
        return False
    if left_s >= 0.5 * next_end_s:
        return False
    here, here_v, here_a = along(this, this[TIME] + 0.5 * left_s, accel, jerk)
    there, there_v, there_a = along(after, 0.5 * left_s, accel, jerk)
    back = here - this[LENGTH]
    cut_n, cut_e = back * this[AHEAD_N] + there * after[AHEAD_N], back * this[AHEAD_E] + there * after[AHEAD_E]
    vel_n, vel_e = here_v * this[AHEAD_N] + there_v * after[AHEAD_N], here_v * this[AHEAD_E] + there_v * after[AHEAD_E]
    acc_n, acc_e = here_a * this[AHEAD_N] + there_a * after[AHEAD_N], here_a * this[AHEAD_E] + there_a * after[AHEAD_E]
    radius = max(tuning.wp_radius, tuning.turn_radius_m if has_steered_wheels(tuning) else 0.0)
    slower = min(this[SPEED], after[SPEED])
    side = tuning.turn_max_g * GRAVITY_M_S2
    gentle = math.hypot(vel_n, vel_e) < slower and math.hypot(acc_n, acc_e) < side
    return bool(gentle and math.hypot(cut_n, cut_e) < radius)


@njit(cache=True, nogil=True)
def add_leg(control: Any, row: int, step_s: float, from_end: bool) -> None:
    """Advance on a leg and add its motion to the inner target; ``from_end``: measured from the end of the leg."""
    leg = control.legs[row]
    leg[TIME] += step_s
    done, speed, accel = along(leg, leg[TIME], control.accel_max, control.jerk_max)
    if from_end:
        done -= leg[LENGTH]
    control.shaped_n += done * leg[AHEAD_N]
    control.shaped_e += done * leg[AHEAD_E]
    control.shaped_vn += speed * leg[AHEAD_N]
    control.shaped_ve += speed * leg[AHEAD_E]
    control.shaped_an += accel * leg[AHEAD_N]
    control.shaped_ae += accel * leg[AHEAD_E]


@njit(cache=True, nogil=True)
def keep_pace(control: Any, tuning: Any, estimate: Any) -> float:
    """Seconds by which the inner target advances: fewer while the rover falls behind."""
    pace, speed = 1.0, math.hypot(control.shaped_vn, control.shaped_ve)
    if control.tick - control.place_tick >= ACTIVE_TICKS:
        speed = 0.0
    if speed > 0.0:
        ahead_n, ahead_e = control.shaped_vn / speed, control.shaped_ve / speed
        behind = (control.shaped_n - estimate.north_m) * ahead_n + (control.shaped_e - estimate.east_m) * ahead_e
        driven = estimate.vel_n * ahead_n + estimate.vel_e * ahead_e
        pace = min(max(PACE_BUFFER + (driven - tuning.pos_p * behind) / speed, 0.0), 1.0)
    slack_s = control.accel_max / control.jerk_max
    control.pace += (pace - control.pace) * LOOP_S / slack_s
    return float(control.pace) * LOOP_S


@njit(cache=True, nogil=True)
def shape_legs(control: Any, tuning: Any, estimate: Any) -> None:
    """Advance the inner target along the legs by one loop, and check whether the present leg is done."""
    step_s = keep_pace(control, tuning, estimate)
    control.shaped_n, control.shaped_e = control.from_n, control.from_e
    control.shaped_vn = control.shaped_ve = control.shaped_an = control.shaped_ae = 0.0
    add_leg(control, BEFORE, step_s, True)
    add_leg(control, THIS, step_s, False)
    left_s = leg_times(control.legs[THIS], control.accel_max, control.jerk_max)[1] - control.legs[THIS, TIME]
    done = left_s <= 0.0
    if control.fast:
        if control.legs[NEXT, TIME] > 0.0:
            add_leg(control, NEXT, step_s, False)
            done |= control.legs[NEXT, TIME] >= left_s
        elif may_turn(control, tuning):
            add_leg(control, NEXT, step_s, False)
    control.place_valid = 1
    if done and not control.reached:
        near = math.hypot(control.dest_n - estimate.north_m, control.dest_e - estimate.east_m) <= tuning.wp_radius
        control.reached = 1 if control.fast or near or is_past(control, estimate) else 0


@njit(cache=True, nogil=True)
def is_past(control: Any, estimate: Any) -> bool:
    """Whether the rover is beyond the line across the end of the leg."""
    leg_n, leg_e = control.dest_n - control.from_n, control.dest_e - control.from_e
    beyond_n, beyond_e = estimate.north_m - control.dest_n, estimate.east_m - control.dest_e
    return bool(leg_n * beyond_n + leg_e * beyond_e >= 0.0)


@njit(cache=True, nogil=True)
def run_leg(control: Any, tuning: Any, estimate: Any) -> None:
    """One loop of driving along the leg; sets ``arrived`` in the loop in which it ends."""
    if control.armed:
        control.nav_tick = control.tick
        changed = control.base_speed != control.speed_max
        if changed and control.tick - control.speed_change_tick >= SPEED_CHANGE_TICKS:
            control.speed_change_tick = control.tick
            control.speed_max = control.base_speed
            change_leg_speed(control, THIS)
            if control.legs[NEXT, TIME] == 0.0 and control.fast:
                change_leg_speed(control, NEXT)
        if not control.pivoting:
            shape_legs(control, tuning, estimate)
        follow_shaped(control, tuning, estimate)
    if control.reached and control.halts:
        run_stop(control, tuning, estimate)
        control.steering = 0.0
    else:
        steer_waypoint(control, tuning, estimate)
    if control.reached and control.fresh_target:
        control.fresh_target = 0
        control.arrived = 1
