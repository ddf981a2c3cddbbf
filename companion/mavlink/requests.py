"""What others ask of the companion itself: guided targets addressed to its own system and component id."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.places import point_of
from companion.vehicle.events.targets import Asker, TargetAnswer, TargetAsked, TargetForm

COMMANDS = (mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
ITEMS = (mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM)
REQUESTS = (*COMMANDS, *ITEMS)
IN_DEGREES = (mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_MISSION_ITEM)
"""These say places as floats in degrees, good to half a metre or worse; the others in whole 1e-7 degrees."""
GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)
"""Latitude and longitude, with altitudes of several kinds, none of which matters to a rover (as ArduRover takes them)."""
GUIDED_ITEM = 2
"""``current`` of a mission item that is no part of a mission but a guided target."""
NO_POSITION = 0b11
"""Bits of a type mask: x or y does not count."""
KEEP_SPEED = (-1.0, 0.0)


def target_asked(message: Any, time_s: float) -> TargetAsked | None:
    """The guided target in a message that is addressed to us; None for other commands and items of missions."""
    number = message.get_msgId()
    asker = Asker(message.get_srcSystem(), message.get_srcComponent())
    if number in COMMANDS:
        if message.command != mavlink.MAV_CMD_DO_REPOSITION:
            return None
        form, speed_m_s = TargetForm.COMMAND, message.param1
    else:
        if message.current != GUIDED_ITEM:
            return None
        form, speed_m_s = TargetForm.ITEM, math.nan
        if message.command != mavlink.MAV_CMD_NAV_WAYPOINT or message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            return _refused(time_s, asker, form, TargetAnswer.UNSUPPORTED, "a guided item must be a waypoint")
    frame = getattr(message, "frame", GLOBAL_FRAMES[0])
    if frame not in GLOBAL_FRAMES:
        return _refused(time_s, asker, form, TargetAnswer.BAD_FRAME, f"frame {frame} has no latitude and longitude")
    point = _place(message)
    if point is None:
        return _refused(time_s, asker, form, TargetAnswer.BAD_VALUE, "no latitude and longitude in it")
    if math.isnan(speed_m_s) or speed_m_s in KEEP_SPEED:
        return TargetAsked(time_s, asker, form, point)
    if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
        return _refused(time_s, asker, form, TargetAnswer.BAD_VALUE, f"a speed of {speed_m_s:g} m/s")
    return TargetAsked(time_s, asker, form, point, speed_m_s)


def is_place(message: Any) -> bool:
    """Whether a SET_POSITION_TARGET_GLOBAL_INT says a place; ArduRover says it in frame 6, its older versions in others."""
    return message.coordinate_frame in GLOBAL_FRAMES and not message.type_mask & NO_POSITION


def _refused(time_s: float, asker: Asker, form: TargetForm, fault: TargetAnswer, reason: str) -> TargetAsked:
    return TargetAsked(time_s, asker, form, None, None, fault, reason)


def _place(message: Any) -> GeoPoint | None:
    if message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        lat, lon = message.param5, message.param6
    else:
        lat, lon = message.x, message.y
    if message.get_msgId() not in IN_DEGREES:
        return point_of(lat, lon)
    return point_of(round(lat * 1e7), round(lon * 1e7)) if math.isfinite(lat) and math.isfinite(lon) else None
