"""Guided targets: which messages move the rover, are refused, or are silently ignored (measured; ModeGuided).

Nouns: ModeGuided.
"""

from __future__ import annotations

import math
from typing import Any

from companion.core.severity import Severity
from sitl.autopilot.channel import Channel
from sitl.autopilot.control.records import HEADING, TURN_RATE
from sitl.autopilot.destination import go_to, valid_place
from sitl.autopilot.vehicle import Vehicle
from sitl.world import geodesy

LOCAL_NED, LOCAL_OFFSET, BODY, BODY_OFFSET = 1, 7, 8, 9

LOCAL_FRAMES = {LOCAL_NED, LOCAL_OFFSET, BODY, BODY_OFFSET}

GLOBAL_FRAMES = {0, 3, 5, 6, 10, 11}

NO_POSITION, NO_VELOCITY, NO_ACCELERATION = 0b11, 0b11 << 3, 0b111 << 6

NO_YAW, NO_YAW_RATE = 1 << 10, 1 << 11

SLOWEST_M_S = 0.05


def local_target(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """SET_POSITION_TARGET_LOCAL_NED."""
    frame, mask = message.coordinate_frame, message.type_mask
    if not vehicle.in_guided or not vehicle.has_origin or frame not in LOCAL_FRAMES:
        return
    if not mask & NO_ACCELERATION:
        vehicle.say(Severity.INFO, "Ignoring SET_POSITION_TARGET_LOCAL_NED; set ACC_IGNORE in mask")
        return
    if mask & NO_POSITION:
        _motion_target(vehicle, message, body=frame in (BODY, BODY_OFFSET))
        return
    north_m, east_m = message.x, message.y
    if not (math.isfinite(north_m) and math.isfinite(east_m) and math.hypot(north_m, east_m) < 1e6):
        return
    if frame in (BODY, BODY_OFFSET):
        ahead, side = math.cos(vehicle.heading_rad()), math.sin(vehicle.heading_rad())
        north_m, east_m = north_m * ahead - east_m * side, north_m * side + east_m * ahead
    start = vehicle.origin if frame == LOCAL_NED else vehicle.place()
    go_to(vehicle, geodesy.moved(start, north_m, east_m))


def global_target(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT; the altitude is ignored."""
    if not vehicle.in_guided or message.coordinate_frame not in GLOBAL_FRAMES:
        return
    if not message.type_mask & NO_ACCELERATION:
        vehicle.say(Severity.INFO, "Ignoring SET_POSITION_TARGET_GLOBAL_INT; set ACC_IGNORE in mask")
        return
    if message.type_mask & NO_POSITION:
        _motion_target(vehicle, message, body=False)
    elif valid_place(message.lat_int, message.lon_int) and vehicle.has_origin:
        go_to(vehicle, (message.lat_int, message.lon_int))


def _motion_target(vehicle: Vehicle, message: Any, body: bool) -> None:
    """A target of velocity, heading and turn rate, in the five valid combinations."""
    mask = message.type_mask
    has_velocity, has_yaw, has_rate = not mask & NO_VELOCITY, not mask & NO_YAW, not mask & NO_YAW_RATE
    values = (message.vx, message.vy, message.yaw, message.yaw_rate)
    if (has_yaw and has_rate) or not (has_velocity or has_yaw or has_rate) or not all(map(math.isfinite, values)):
        return
    speed_m_s = heading_rad = 0.0
    if has_velocity:
        speed_m_s = min(math.hypot(message.vx, message.vy), vehicle.parameters["WP_SPEED"])
        heading_rad = math.atan2(message.vy, message.vx)
        if (has_yaw or has_rate) and message.vx < 0.0:
            speed_m_s = -speed_m_s
    if has_yaw:
        heading_rad = message.yaw
    if body:
        heading_rad += vehicle.heading_rad()
    control = vehicle.control
    control["task"] = TURN_RATE if has_rate else HEADING
    control["target_heading"] = heading_rad
    control["target_turn_rate"] = message.yaw_rate if has_rate else 0.0
    control["target_speed"] = speed_m_s
    control["target_tick"] = control["tick"]
    control["have_target"] = 1


def attitude_target(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """SET_ATTITUDE_TARGET: thrust as a share of WP_SPEED, with a heading or a turn rate."""
    if not vehicle.in_guided or message.type_mask & (1 << 6) or not math.isfinite(message.thrust):
        return
    w, x, y, z = message.q
    rate, heading = message.body_yaw_rate, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    if not (math.isfinite(rate) and math.isfinite(heading)):
        return
    control = vehicle.control
    by_heading = bool(message.type_mask & (1 << 2))
    control["task"] = HEADING if by_heading else TURN_RATE
    control["target_heading"] = heading
    control["target_turn_rate"] = rate
    control["target_speed"] = vehicle.parameters["WP_SPEED"] * min(max(message.thrust, -1.0), 1.0)
    control["target_tick"] = control["tick"]
    control["have_target"] = 1
