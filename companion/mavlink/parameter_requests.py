"""What others ask of the companion itself. A request counts if it is for our system, and for us or for everybody."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.vehicle.events.parameters import ParameterAsked, ParameterChangeAsked, ParameterRequest, ParametersAsked

EVERYBODY = 0


def _list(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParametersAsked(time_s)


def _read(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParameterAsked(time_s, _name(message), message.param_index)


def _set(message: Any, time_s: float, to_us: bool) -> ParameterRequest:
    return ParameterChangeAsked(time_s, _name(message), message.param_value, to_us)


def _name(message: Any) -> str:
    """As ArduPilot reads it: up to 16 characters, capital letters or small ones."""
    return "".join(c for c in str(message.param_id) if c.isascii() and c.isprintable()).upper()


READERS: dict[int, Callable[[Any, float, bool], ParameterRequest]] = {
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: _list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: _read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: _set,
}


def request(message: Any, system_id: int, component_id: int, time_s: float) -> ParameterRequest | None:
    """The request in a message of ``READERS``; None when it is for somebody else."""
    if message.target_system not in (EVERYBODY, system_id) or message.target_component not in (EVERYBODY, component_id):
        return None
    return READERS[message.get_msgId()](message, time_s, message.target_component == component_id)
