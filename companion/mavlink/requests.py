"""Requests of ground stations to the companion itself, and its answers: guided targets, pause, its own parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.positions import point_of
from companion.mission.mav_commands import GLOBAL_FRAMES
from companion.vehicle.commands import AnswerRequest
from companion.vehicle.events import (
    Asker,
    GoalRequested,
    ParameterAsked,
    ParameterChangeAsked,
    ParameterRequest,
    ParametersAsked,
    PauseAsked,
    RequestAnswer,
    RequestForm,
    TargetAsked,
)

COMMANDS = (mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
ITEMS = (mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM)
REQUESTS = (*COMMANDS, *ITEMS)
IN_DEGREES = (mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_MISSION_ITEM)
"""These hold places as floats in degrees, exact to half a metre at best; the others hold 1e-7 degrees."""
GUIDED_ITEM = 2
"""``current`` of a mission item that is a guided target."""
KEEP_SPEED = -1.0
PAUSE, CONTINUE = 0.0, 1.0
NO_POSITION = 0b11
"""Bits of a type mask: x or y is not used."""
COMMAND_RESULTS: Mapping[RequestAnswer, int] = MappingProxyType(
    {
        RequestAnswer.ACCEPTED: mavlink.MAV_RESULT_ACCEPTED,
        RequestAnswer.DENIED: mavlink.MAV_RESULT_DENIED,
        RequestAnswer.NOT_NOW: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
        RequestAnswer.BAD_FRAME: mavlink.MAV_RESULT_DENIED,
        RequestAnswer.BAD_VALUE: mavlink.MAV_RESULT_DENIED,
        RequestAnswer.UNSUPPORTED: mavlink.MAV_RESULT_UNSUPPORTED,
    }
)
"""ArduRover denies local frames and places of zeros too."""
ITEM_RESULTS: Mapping[RequestAnswer, int] = MappingProxyType(
    {
        RequestAnswer.ACCEPTED: mavlink.MAV_MISSION_ACCEPTED,
        RequestAnswer.DENIED: mavlink.MAV_MISSION_DENIED,
        RequestAnswer.NOT_NOW: mavlink.MAV_MISSION_ERROR,
        RequestAnswer.BAD_FRAME: mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
        RequestAnswer.BAD_VALUE: mavlink.MAV_MISSION_INVALID_PARAM5_X,
        RequestAnswer.UNSUPPORTED: mavlink.MAV_MISSION_UNSUPPORTED,
    }
)
EVERYBODY = 0
ANSWERED: Mapping[RequestForm, int] = MappingProxyType(
    {
        RequestForm.COMMAND: mavlink.MAV_CMD_DO_REPOSITION,
        RequestForm.PAUSE: mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
        RequestForm.CONTINUE: mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
        RequestForm.SKIP: mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
    }
)
"""The command of a request that is answered with COMMAND_ACK."""


def asked(message: Any, time_s: float) -> GoalRequested | PauseAsked | TargetAsked | None:
    """The request in a message to the companion; None for other commands and for items of missions."""
    if message.get_msgId() not in COMMANDS:
        return target_asked(message, time_s)
    asker, value = Asker(message.get_srcSystem(), message.get_srcComponent()), message.param1
    match message.command:
        case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if value in (PAUSE, CONTINUE):
            return PauseAsked(time_s, asker, value == PAUSE)
        case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT if math.isfinite(value) and value == int(value):
            return TargetAsked(time_s, asker, int(value))
        case _:
            return target_asked(message, time_s)


def target_asked(message: Any, time_s: float) -> GoalRequested | None:
    """The guided target in a message to the companion; None for other commands and for items of missions."""
    number = message.get_msgId()
    asker = Asker(message.get_srcSystem(), message.get_srcComponent())
    if number in COMMANDS:
        if message.command != mavlink.MAV_CMD_DO_REPOSITION:
            return None
        form, speed_m_s = RequestForm.COMMAND, message.param1
    else:
        if message.current != GUIDED_ITEM:
            return None
        form, speed_m_s = RequestForm.ITEM, math.nan
        if message.command != mavlink.MAV_CMD_NAV_WAYPOINT or message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            return _refused(time_s, asker, form, RequestAnswer.UNSUPPORTED, "a guided item must be a waypoint")
    frame = getattr(message, "frame", GLOBAL_FRAMES[0])
    if frame not in GLOBAL_FRAMES:
        return _refused(time_s, asker, form, RequestAnswer.BAD_FRAME, f"frame {frame} has no latitude and longitude")
    point = _place(message)
    if point is None:
        return _refused(time_s, asker, form, RequestAnswer.BAD_VALUE, "no valid latitude and longitude in it")
    if math.isnan(speed_m_s) or speed_m_s in (KEEP_SPEED, 0.0):
        return GoalRequested(time_s, asker, form, point)
    if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
        return _refused(time_s, asker, form, RequestAnswer.BAD_VALUE, f"a speed of {speed_m_s:g} m/s")
    return GoalRequested(time_s, asker, form, point, speed_m_s)


def is_place(message: Any) -> bool:
    """Whether a SET_POSITION_TARGET_GLOBAL_INT holds a place; ArduRover uses frame 6, older versions others."""
    return message.coordinate_frame in GLOBAL_FRAMES and not message.type_mask & NO_POSITION


def _refused(time_s: float, asker: Asker, form: RequestForm, fault: RequestAnswer, reason: str) -> GoalRequested:
    return GoalRequested(time_s, asker, form, None, None, fault, reason)


def _place(message: Any) -> GeoPoint | None:
    if message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        lat, lon = message.param5, message.param6
    else:
        lat, lon = message.x, message.y
    if message.get_msgId() not in IN_DEGREES:
        return point_of(lat, lon)
    return point_of(round(lat * 1e7), round(lon * 1e7)) if math.isfinite(lat) and math.isfinite(lon) else None


def answer_message(command: AnswerRequest) -> Any:
    """The message that answers a request."""
    to = (command.asker.system_id, command.asker.component_id)
    if command.form in ANSWERED:
        result = COMMAND_RESULTS[command.answer]
        return mavlink.MAVLink_command_ack_message(ANSWERED[command.form], result, 0, 0, *to)
    return mavlink.MAVLink_mission_ack_message(*to, ITEM_RESULTS[command.answer], mavlink.MAV_MISSION_TYPE_MISSION)


def _parameters_asked(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParametersAsked(time_s)


def _parameter_asked(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParameterAsked(time_s, _name(message), message.param_index)


def _change_asked(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParameterChangeAsked(time_s, _name(message), message.param_value, to_us)


def _name(message: Any) -> str:
    """A parameter's name as ArduPilot reads it: up to 16 characters, in any case."""
    return "".join(c for c in str(message.param_id) if c.isascii() and c.isprintable()).upper()


PARAMETER_REQUESTS: dict[int, Callable[[Any, float, bool], ParameterRequest]] = {
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: _parameters_asked,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: _parameter_asked,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: _change_asked,
}


def parameter_asked(message: Any, system_id: int, component_id: int, time_s: float) -> ParameterRequest | None:
    """The request in a message of ``PARAMETER_REQUESTS``; None if it is for another component or system."""
    if message.target_system not in (EVERYBODY, system_id) or message.target_component not in (EVERYBODY, component_id):
        return None
    return PARAMETER_REQUESTS[message.get_msgId()](message, time_s, message.target_component == component_id)
