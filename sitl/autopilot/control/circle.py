"""Driving circles around a place, as LOITER_TURNS does (behaviour of ModeCircle; compiled).

Nouns: ModeCircle.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import GRAVITY_M_S2
from sitl.autopilot.control.pos_control import ACTIVE_TICKS, follow_shaped, restart_shaping, steer_waypoint
from sitl.autopilot.control.records import CIRCLE, LOOP_S
from sitl.autopilot.control.shaping import ShapingLimits, limited, shaped_accel

EDGE_M = 0.5
"""Distance from the circle within which the rover counts as on it (or TURN_RADIUS, if that is larger)."""


@njit(cache=True, nogil=True)
def begin_circle(control: Any, estimate: Any, centre_n: float, centre_e: float, radius: float) -> None:
    """Begin to circle a place (metres from the EKF origin); a negative radius means anticlockwise."""
    control.dest_n, control.dest_e = centre_n, centre_e
    control.circle_radius = radius
    control.circle_turned = control.circle_speed = 0.0
    control.on_circle = control.pivoting = control.reached = 0
    north, east = estimate.north_m - centre_n, estimate.east_m - centre_e
    control.circle_angle = math.atan2(east, north) if north != 0.0 or east != 0.0 else estimate.heading_rad
    control.task = CIRCLE


@njit(cache=True, nogil=True)
def run_circle(control: Any, tuning: Any, estimate: Any) -> None:
    """One loop of circling."""
    if control.armed:
        control.nav_tick = control.tick
        if control.tick - control.place_tick >= ACTIVE_TICKS:
            restart_shaping(control, estimate)
        control.speed_max = control.base_speed
        move_on_circle(control, tuning, estimate)
        follow_shaped(control, tuning, estimate)
    steer_waypoint(control, tuning, estimate)


@njit(cache=True, nogil=True)
def move_on_circle(control: Any, tuning: Any, estimate: Any) -> None:
    """Move the point on the circle, and the inner target after it."""
    radius = abs(control.circle_radius)
    from_centre = math.hypot(estimate.north_m - control.dest_n, estimate.east_m - control.dest_e)
    if abs(from_centre - radius) <= max(tuning.turn_radius_m, EDGE_M):
        control.on_circle = 1
    # The centripetal acceleration belongs to the moving point; only the rest is shaped.
    inwards = control.circle_speed**2 / radius
    beside_n = control.shaped_an + inwards * math.cos(control.circle_angle)
    beside_e = control.shaped_ae + inwards * math.sin(control.circle_angle)
    desired = control.base_speed if control.on_circle else 0.0
    control.circle_speed += limited(desired - control.circle_speed, control.accel_max * LOOP_S)
    sign = 1.0 if control.circle_radius > 0.0 else -1.0
    turn = control.circle_speed / radius * LOOP_S
    control.circle_angle += sign * turn
    control.circle_turned += turn
    out_n, out_e = math.cos(control.circle_angle), math.sin(control.circle_angle)
    speed, inwards = control.circle_speed, control.circle_speed**2 / radius
    vel_n, vel_e = -sign * speed * out_e, sign * speed * out_n
    control.shaped_n += control.shaped_vn * LOOP_S + 0.5 * control.shaped_an * LOOP_S * LOOP_S
    control.shaped_e += control.shaped_ve * LOOP_S + 0.5 * control.shaped_ae * LOOP_S * LOOP_S
    control.shaped_vn += control.shaped_an * LOOP_S
    control.shaped_ve += control.shaped_ae * LOOP_S
    accel_max = min(control.accel_max, tuning.turn_max_g * GRAVITY_M_S2)
    # Relative to the moving point, the inner target comes to rest on it.
    gain_n, gain_e = shaped_accel(
        (control.dest_n + radius * out_n - control.shaped_n, control.dest_e + radius * out_e - control.shaped_e),
        (control.shaped_vn - vel_n, control.shaped_ve - vel_e),
        (beside_n, beside_e),
        ShapingLimits(control.speed_max, accel_max, control.jerk_max),
        LOOP_S,
    )
    control.shaped_an, control.shaped_ae = gain_n - inwards * out_n, gain_e - inwards * out_e
    control.place_valid = 1
