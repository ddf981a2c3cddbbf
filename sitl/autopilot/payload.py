"""Servos, relays, gripper, sprayer, camera and gimbal: what ArduRover answers to their commands, and a log of them.

Nothing is simulated behind the outputs: a command that is accepted is in the log. The answers are those of
GCS_ServoRelay.cpp, GCS_Common.cpp, AP_Camera.cpp and AP_Mount.cpp (4.7.0-dev, October 2025).

Nouns: payload, command event.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.control.servo_outputs import OUTPUTS
from sitl.autopilot.vehicle import Vehicle

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
MOST_OUTPUTS = 32
FREE_FUNCTIONS = frozenset({0, 1, 22, 23, 28, *range(51, 67), *range(140, 156)})
"""SERVOn_FUNCTION of outputs that commands may set: none, manual, sprayer, gripper, passed through from the pilot."""
RELAYS = 6
RELAY_FUNCTION = 1
FIRST_CAMERA_THAT_RECORDS = 4
"""CAM1_TYPE: servo, relay and GoPro take pictures; from the gimbal's camera on they record and zoom, too."""
HIGHEST_SWITCH = 2.0

SERVO = (mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_REPEAT_SERVO)
RELAY = (mavlink.MAV_CMD_DO_SET_RELAY, mavlink.MAV_CMD_DO_REPEAT_RELAY)
ALWAYS = (
    mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mavlink.MAV_CMD_DO_SPRAYER,
    mavlink.MAV_CMD_DO_SET_ROI_NONE,
)
"""Accepted whether or not there is such a thing."""
ROI = (mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_DO_SET_ROI_LOCATION)
GIMBAL = (
    mavlink.MAV_CMD_DO_MOUNT_CONFIGURE,
    mavlink.MAV_CMD_DO_MOUNT_CONTROL,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
    mavlink.MAV_CMD_DO_SET_ROI_SYSID,
)
SET_CAMERA_SOURCE = 534
VIDEO = (mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE)
CAMERA = (
    mavlink.MAV_CMD_IMAGE_START_CAPTURE,
    mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
    mavlink.MAV_CMD_SET_CAMERA_ZOOM,
    mavlink.MAV_CMD_SET_CAMERA_FOCUS,
    SET_CAMERA_SOURCE,
    *VIDEO,
)
COMMANDS = frozenset(
    {
        *SERVO, *RELAY, *ALWAYS, *ROI, *GIMBAL, *CAMERA,
        mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_CMD_DO_AUX_FUNCTION,
    }
)  # fmt: skip
LOGGED = COMMANDS | {mavlink.MAV_CMD_DO_SET_HOME, mavlink.MAV_CMD_DO_FENCE_ENABLE}
"""Commands that a mission gives at its places; they are in the log, and faults befall them."""
RESULTS = {0: "accepted", 1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed"}


@dataclass(frozen=True, slots=True)
class CommandEvent:
    """A command that the autopilot has answered (``result``: MAV_RESULT), and where the rover was (world frame).

    ``in_auto``: it was an item of the autopilot's own mission.
    """

    time_s: float
    command: int
    params: tuple[float, ...]
    result: int
    north_m: float
    east_m: float
    in_auto: bool = False

    @property
    def name(self) -> str:
        """Of the command, with its first parameters."""
        entry = mavlink.enums["MAV_CMD"].get(self.command)
        name = str(self.command) if entry is None else entry.name.removeprefix("MAV_CMD_")
        last = max((i for i, value in enumerate(self.params[:4], 1) if value), default=0)
        return " ".join([name, *(f"{value:g}" for value in self.params[:last])])

    @property
    def result_name(self) -> str:
        """In words."""
        return RESULTS.get(self.result, f"result {self.result}")

    def as_json(self) -> dict[str, object]:
        """For files."""
        values = [None if math.isnan(value) else value for value in self.params]
        return {
            "time_s": round(self.time_s, 2),
            "command": self.command,
            "name": self.name,
            "params": values,
            "result": self.result_name,
            "in_auto": self.in_auto,
        }


def command_of_name(name: str) -> int:
    """The number of a command that is in the log. Raises ValueError with the reason."""
    number: int | None = getattr(mavlink, f"MAV_CMD_{name.upper().removeprefix('MAV_CMD_')}", None)
    if number is None or number not in LOGGED:
        known = ", ".join(sorted(mavlink.enums["MAV_CMD"][one].name.removeprefix("MAV_CMD_") for one in LOGGED))
        raise ValueError(f"commands: {name!r:.60} is none that a mission gives; those are {known}")
    return number


def params_of(message: Any) -> tuple[float, ...]:
    """p1 to p7 of COMMAND_LONG or COMMAND_INT; a place in degrees."""
    first = (message.param1, message.param2, message.param3, message.param4)
    if message.get_type() == "COMMAND_LONG":
        return (*first, message.param5, message.param6, message.param7)
    return (*first, message.x / 1e7, message.y / 1e7, message.z)


def run_payload(vehicle: Vehicle, command: int, params: tuple[float, ...], frame: int | None = None) -> int:
    """Answer a command of ``COMMANDS``. Raises ValueError for NaN where a number is needed."""
    if command in SERVO:
        return _servo(vehicle, int(params[0]))
    if command in RELAY:
        return _relay(vehicle, int(params[0]))
    if command in ALWAYS:
        return ACCEPTED
    if command in ROI:
        if frame is not None and frame not in mavlink_frames():
            return DENIED
        return ACCEPTED if abs(params[4]) <= 90.0 and abs(params[5]) <= 180.0 else FAILED
    if command in GIMBAL:
        return ACCEPTED if vehicle.parameters["MNT1_TYPE"] > 0.0 else FAILED
    if command in CAMERA:
        return _camera(vehicle, command, params)
    if command == mavlink.MAV_CMD_DO_GRIPPER:
        works = vehicle.parameters["GRIP_ENABLE"] > 0.0 and int(params[1]) in (0, 1)
        return ACCEPTED if works else FAILED
    return DENIED if params[1] > HIGHEST_SWITCH else ACCEPTED


def mavlink_frames() -> tuple[int, ...]:
    """Frames with latitude and longitude."""
    return (0, 3, 5, 6, 10, 11)


def _servo(vehicle: Vehicle, number: int) -> int:
    """An output may be set unless the autopilot itself uses it."""
    if not 1 <= number <= MOST_OUTPUTS:
        return FAILED
    function = vehicle.parameters[f"SERVO{number}_FUNCTION"] if number <= OUTPUTS else 0.0
    if int(function) in FREE_FUNCTIONS:
        return ACCEPTED
    vehicle.say(Severity.INFO, f"ServoRelayEvent: Channel {number} is already in use")
    return FAILED


def _relay(vehicle: Vehicle, number: int) -> int:
    """Relays are counted from 0 by commands, from 1 by parameters."""
    if not 0 <= number < RELAYS:
        return FAILED
    table, name = vehicle.parameters, f"RELAY{number + 1}"
    enabled = int(table[f"{name}_FUNCTION"]) == RELAY_FUNCTION and int(table[f"{name}_PIN"]) != -1
    return ACCEPTED if enabled else FAILED


def _camera(vehicle: Vehicle, command: int, params: tuple[float, ...]) -> int:
    kind = int(vehicle.parameters["CAM1_TYPE"])
    records = kind >= FIRST_CAMERA_THAT_RECORDS
    if command == mavlink.MAV_CMD_IMAGE_START_CAPTURE:
        if params[0] < 0.0:
            return UNSUPPORTED
        return ACCEPTED if kind > 0 else FAILED
    if command == mavlink.MAV_CMD_IMAGE_STOP_CAPTURE:
        return ACCEPTED if params[0] == 0.0 or kind > 0 else UNSUPPORTED
    refused = {mavlink.MAV_CMD_SET_CAMERA_ZOOM: UNSUPPORTED, SET_CAMERA_SOURCE: DENIED}
    return ACCEPTED if records else refused.get(command, FAILED)


def note(vehicle: Vehicle, command: int, params: tuple[float, ...], result: int, *, in_auto: bool = False) -> None:
    """Keep a command in the log."""
    rover = vehicle.rover[0]
    place = (float(rover["north_m"]), float(rover["east_m"]))
    since_s = vehicle.command_log.booted_s
    vehicle.command_log.events.append(CommandEvent(since_s + vehicle.time_s, command, params, result, *place, in_auto))
