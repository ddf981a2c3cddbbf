"""MAVLink commands (COMMAND_LONG, COMMAND_INT) and their acknowledgements (measured)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.channel import Channel
from sitl.autopilot.control.records import LOOP_HZ
from sitl.autopilot.destination import change_speed, go_to, valid_place
from sitl.autopilot.fence import enable_fence
from sitl.autopilot.mode_auto import AutoRunner
from sitl.autopilot.mode_guided import GLOBAL_FRAMES
from sitl.autopilot.modes import FORCE, arm, arming_faults, disarm, set_mode
from sitl.autopilot.payload import COMMANDS, LOGGED, note, params_of, run_payload
from sitl.autopilot.state import CommandTrouble, Mode
from sitl.autopilot.streams import DEFAULT_INTERVAL_US, set_interval
from sitl.autopilot.telemetry import MESSAGES, streamable
from sitl.autopilot.vehicle import Vehicle

ACCEPTED, TRY_LATER, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4

LONGEST_US = 60_000_000

Handler = Callable[[Vehicle, Channel, Any], int]


def answer(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """Carry out a command and acknowledge it, unless a fault stands in its way."""
    trouble = _trouble(vehicle, message.command)
    if trouble is not None and trouble.lost:
        return
    if trouble is not None and trouble.result is not None:
        result = trouble.result
    else:
        result = _carried_out(vehicle, channel, message)
    if message.command in LOGGED:
        note(vehicle, message.command, params_of(message), result)
    if trouble is not None and trouble.unanswered:
        return
    channel.send(
        mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
    )


def _trouble(vehicle: Vehicle, command: int) -> CommandTrouble | None:
    """What befalls this command."""
    if not vehicle.command_troubles or command not in LOGGED:
        return None
    return next((one for one in vehicle.command_troubles if one.befalls(command)), None)


def _carried_out(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    """MAV_RESULT."""
    if message.command == mavlink.MAV_CMD_DO_REPOSITION:
        result = _reposition(vehicle, message)
    else:
        handler = HANDLERS.get(message.command)
        try:
            result = UNSUPPORTED if handler is None else handler(vehicle, channel, message)
        except (ValueError, OverflowError):  # NaN, infinity or out of range
            result = DENIED
    return result


def _reposition(vehicle: Vehicle, message: Any) -> int:
    if message.get_type() != "COMMAND_INT":
        return UNSUPPORTED
    change_mode = math.isfinite(message.param2) and int(message.param2) & 1
    if not vehicle.in_guided and not change_mode:
        return DENIED
    if message.frame not in GLOBAL_FRAMES or not valid_place(message.x, message.y) or (message.x, message.y) == (0, 0):
        return DENIED
    if not vehicle.in_guided and not set_mode(vehicle, Mode.GUIDED):
        return FAILED
    if message.param1 > 0.0 and not change_speed(vehicle, message.param1):
        return FAILED
    if not vehicle.has_origin:
        return FAILED
    go_to(vehicle, (message.x, message.y))
    return ACCEPTED


def _do_set_mode(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    if not int(message.param1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if set_mode(vehicle, int(message.param2)) else FAILED


def _arm_disarm(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    force = math.isfinite(message.param2) and int(message.param2) in FORCE
    if message.param1 == 1.0:
        return ACCEPTED if arm(vehicle, force) else FAILED
    if message.param1 == 0.0:
        disarm(vehicle)
        return ACCEPTED
    return UNSUPPORTED


def _set_interval(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    number, interval_us = int(message.param1), int(message.param2)
    if not streamable(number):
        vehicle.say(Severity.INFO, f"No ap_message for mavlink id ({number})")
        return DENIED
    if interval_us < -1:
        return DENIED
    if interval_us == 0:
        interval_us = DEFAULT_INTERVAL_US if number in MESSAGES else -1
    # The firmware's rule: the interval may not be shorter than 1.25 loops.
    elif interval_us > 0 and interval_us // 1000 * 800 < 1_000_000 // LOOP_HZ:
        vehicle.say(Severity.INFO, f"Requested rate for message ID {number} too fast. Increase SCHED_LOOP_RATE")
        return DENIED
    set_interval(channel, number, min(interval_us, LONGEST_US), vehicle.time_us)
    return ACCEPTED


def _get_interval(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    number = int(message.param1)
    if not streamable(number):
        return FAILED
    channel.send(mavlink.MAVLink_message_interval_message(number, channel.interval_us.get(number, -1)))
    return ACCEPTED


def _request_message(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    number = int(message.param1)
    if not streamable(number):
        return FAILED
    # It goes out with the next loop, after the acknowledgement.
    channel.requested.append(number)
    return ACCEPTED


def _request_version(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    channel.requested.append(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    return ACCEPTED


def _change_speed(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    if message.param1 not in (0.0, 1.0):
        return DENIED
    return ACCEPTED if change_speed(vehicle, message.param2) else FAILED


def _set_reverse(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    vehicle.control["reversed"] = 1 if message.param1 == 1.0 else 0
    return ACCEPTED


def _mission_start(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    if message.param1 != 0.0 or message.param2 != 0.0:  # only the whole mission
        return DENIED
    return ACCEPTED if set_mode(vehicle, Mode.AUTO) else FAILED


def _set_mission_current(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    seq = int(message.param1)
    if seq < 0 or not vehicle.mission.set_current(seq, AutoRunner(vehicle)):
        return FAILED
    if message.param2 == 1.0:
        vehicle.mission.jumps.clear()
    for listener in vehicle.channels.values():
        listener.requested.append(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)
    return ACCEPTED


def _fence_enable(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    return ACCEPTED if enable_fence(vehicle, int(message.param1)) else FAILED


def _return(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    return ACCEPTED if set_mode(vehicle, Mode.RTL) else FAILED


def _place_of(message: Any) -> tuple[int, tuple[int, int]]:
    """Frame, and latitude and longitude in 1e-7 degree; COMMAND_LONG has degrees, in the frame GLOBAL."""
    if message.get_type() == "COMMAND_INT":
        return message.frame, (message.x, message.y)
    degrees = (0.0 if math.isnan(value) else value for value in (message.param5, message.param6))
    lat, lon = (round(value * 1e7) for value in degrees)
    return mavlink.MAV_FRAME_GLOBAL, (lat, lon)


def _set_home(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    """DO_SET_HOME: here (param1 = 1, or no place given) or at a place."""
    if math.isnan(message.param1):
        return DENIED
    frame, place = _place_of(message)
    if message.param1 == 1.0 or place == (0, 0):
        if not vehicle.has_position:
            return FAILED
        place = vehicle.place()
    elif message.param1 != 0.0 or not valid_place(*place):
        return FAILED
    elif frame not in GLOBAL_FRAMES:
        return DENIED
    vehicle.move_home(place)
    return ACCEPTED


def _get_home(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    if not vehicle.has_home:
        return FAILED
    channel.requested += [mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN]
    return ACCEPTED


def _check_arming(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    """RUN_PREARM_CHECKS: accepted whatever the result; complaints follow as texts."""
    if vehicle.armed:
        return TRY_LATER
    for fault in arming_faults(vehicle):
        vehicle.say(Severity.CRITICAL, f"PreArm: {fault.text}")
    return ACCEPTED


def _payload(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    return run_payload(vehicle, message.command, params_of(message), getattr(message, "frame", None))


def _reboot(vehicle: Vehicle, channel: Channel, message: Any) -> int:
    if message.param1 not in (1.0, 3.0):
        return UNSUPPORTED
    if vehicle.armed:
        return FAILED
    vehicle.rebooting = True
    return ACCEPTED


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_DO_SET_MODE: _do_set_mode,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_version,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: _check_arming,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_DO_SET_REVERSE: _set_reverse,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_mission_current,
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _fence_enable,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    **dict.fromkeys(COMMANDS, _payload),
}
"""Everything else is UNSUPPORTED."""
