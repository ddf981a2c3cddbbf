"""What the autopilot does with each MAVLink message that is meant for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.channel import Channel
from sitl.autopilot.commands import answer
from sitl.autopilot.ftp import answer_file_request
from sitl.autopilot.links import set_up_signing
from sitl.autopilot.mission_protocol import TRANSFERS
from sitl.autopilot.mode_auto import set_mission_current
from sitl.autopilot.mode_guided import attitude_target, global_target, local_target
from sitl.autopilot.modes import apply_sticks, set_mode
from sitl.autopilot.proximity import take_in
from sitl.autopilot.state import Sticks
from sitl.autopilot.streams import set_group
from sitl.autopilot.vehicle import Vehicle, parameter_message

UNCHANGED, RELEASED = 65535, 32767


def _text_of(name: Any) -> str:
    return name if isinstance(name, str) else bytes(name).split(b"\0")[0].decode("ascii", "replace")


def _read_parameter(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    name = _text_of(message.param_id) if message.param_index < 0 else vehicle.parameters.name_of(message.param_index)
    if name is not None and name in vehicle.parameters:
        channel.send(parameter_message(vehicle.parameters, name, in_list=message.param_index >= 0))


def _list_parameters(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    channel.parameter_queue[:] = list(vehicle.parameters)


def _set_parameter(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    name = _text_of(message.param_id)
    if not vehicle.parameters.set(name, message.param_value):
        return  # no answer: unknown name, or not a number
    vehicle.retune()
    for listener in vehicle.channels.values():
        listener.send(parameter_message(vehicle.parameters, name))


def _old_set_mode(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        set_mode(vehicle, message.custom_mode)


def _heartbeat(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    if message.get_srcSystem() == int(vehicle.parameters["MAV_GCS_SYSID"]):
        vehicle.clocks.ground_station_s = vehicle.time_s
    if message.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER:
        sender, known = (message.get_srcSystem(), message.get_srcComponent()), vehicle.onboard_controller
        if known is None or known[:2] == sender:
            vehicle.onboard_controller = (*sender, channel.number)


def _override(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """RC_CHANNELS_OVERRIDE of the ground station: steering and throttle; 0 releases, 65535 means unchanged."""
    sticks = vehicle.sticks
    steering, throttle = (
        before if raw_us == UNCHANGED else None if raw_us == 0 else (raw_us - 1500) / 500.0
        for raw_us, before in ((message.chan1_raw, sticks.steering), (message.chan3_raw, sticks.throttle))
    )
    _take_sticks(vehicle, message, steering, throttle)


def _manual_control(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MANUAL_CONTROL, a joystick: y is steering, z throttle, in thousandths; 32767 releases."""
    if message.target == vehicle.system:
        axes = (None if axis == RELEASED else axis / 1000.0 for axis in (message.y, message.z))
        _take_sticks(vehicle, message, *axes)


def _take_sticks(vehicle: Vehicle, message: Any, steering: float | None, throttle: float | None) -> None:
    """Set the ground station's sticks, -1 to 1, None where released. They also count as a sign of life."""
    is_station = message.get_srcSystem() == int(vehicle.parameters["MAV_GCS_SYSID"])
    if not is_station:
        return
    vehicle.clocks.ground_station_s = vehicle.time_s
    if vehicle.parameters["RC_OVERRIDE_TIME"] == 0.0:
        return
    held, pushed = (0.0 if axis is None else min(max(axis, -1.0), 1.0) for axis in (steering, throttle))
    vehicle.sticks = Sticks(held, pushed, None if steering is None and throttle is None else vehicle.time_s)
    apply_sticks(vehicle)


def _data_stream(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    rate_hz = message.req_message_rate if message.start_stop else 0
    set_group(channel, message.req_stream_id, rate_hz, vehicle.time_us)


def _timesync(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    if message.tc1 == 0:
        channel.send(mavlink.MAVLink_timesync_message(vehicle.time_us * 1000, message.ts1))


def _obstacles(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    take_in(vehicle, message)


HANDLERS: dict[str, Callable[[Vehicle, Channel, Any], None]] = {
    "COMMAND_LONG": answer,
    "COMMAND_INT": answer,
    "FILE_TRANSFER_PROTOCOL": answer_file_request,
    "HEARTBEAT": _heartbeat,
    "MANUAL_CONTROL": _manual_control,
    "MISSION_SET_CURRENT": set_mission_current,
    "OBSTACLE_DISTANCE": _obstacles,
    "PARAM_REQUEST_LIST": _list_parameters,
    "PARAM_REQUEST_READ": _read_parameter,
    "PARAM_SET": _set_parameter,
    "RC_CHANNELS_OVERRIDE": _override,
    "REQUEST_DATA_STREAM": _data_stream,
    "SET_ATTITUDE_TARGET": attitude_target,
    "SET_MODE": _old_set_mode,
    "SET_POSITION_TARGET_GLOBAL_INT": global_target,
    "SET_POSITION_TARGET_LOCAL_NED": local_target,
    "SETUP_SIGNING": set_up_signing,
    "TIMESYNC": _timesync,
    **TRANSFERS,
}
"""By message name; all other messages are ignored."""
