"""Reads back what the companion told the autopilot: setpoints and speeds from the packets that it sent."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.encode import POSITION_ONLY, VELOCITY_AND_YAW_RATE, YAW_ONLY
from companion.mavlink.positions import point_of
from companion.mavlink.requests import GUIDED_ITEM
from companion.vehicle.commands import ChangeSpeed, GuidedHeading, GuidedPosition, GuidedVelocity

Told = GuidedPosition | GuidedVelocity | GuidedHeading | ChangeSpeed


def told_by(raw: bytes, origin: GeoPoint | None) -> Told | None:
    """The setpoint or speed in a packet of the companion; None for any other packet.

    ``origin``: that of the local frame; a place in degrees is None without it.
    """
    try:
        message: Any = mavlink.MAVLink(None).decode(bytearray(raw))
    except mavlink.MAVError:
        return None
    match message.get_msgId():
        case mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
            return _local(message)
        case mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
            return _place(message.lat_int, message.lon_int, origin)
        case mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT if message.current == GUIDED_ITEM:
            return _place(message.x, message.y, origin)
        case mavlink.MAVLINK_MSG_ID_COMMAND_INT if message.command == mavlink.MAV_CMD_DO_REPOSITION:
            return _place(message.x, message.y, origin)
        case mavlink.MAVLINK_MSG_ID_COMMAND_LONG if message.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            return ChangeSpeed(message.param2)
        case _:
            return None


def _local(message: Any) -> Told | None:
    """By the fields that count."""
    match message.type_mask:
        case mask if mask == POSITION_ONLY:
            return GuidedPosition(NedPoint(message.x, message.y))
        case mask if mask == VELOCITY_AND_YAW_RATE:
            return GuidedVelocity(message.vx, message.yaw_rate)
        case mask if mask == YAW_ONLY:
            return GuidedHeading(message.yaw % (2.0 * math.pi))
        case _:
            return None


def _place(lat_e7: int, lon_e7: int, origin: GeoPoint | None) -> GuidedPosition | None:
    point = point_of(lat_e7, lon_e7)
    return None if point is None or origin is None else GuidedPosition(LocalFrame(origin).to_ned(point))
