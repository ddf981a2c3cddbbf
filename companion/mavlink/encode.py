"""Encodes the companion's commands as MAVLink packets."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.requests import GUIDED_ITEM, KEEP_SPEED, answer_message
from companion.mavlink.signing import Signer
from companion.mavlink.statustext import chunks_of
from companion.vehicle.commands import (
    AnswerRequest,
    Arm,
    ChangeSpeed,
    Command,
    EndTransfer,
    FileRequest,
    GuidedHeading,
    GuidedPosition,
    GuidedVelocity,
    Heartbeat,
    NamedValue,
    ParameterValue,
    ReadParameter,
    RequestItem,
    RequestList,
    RequestMessage,
    RequestRate,
    RunCommand,
    RunPrearmChecks,
    SetMode,
    StatusText,
    TimeSync,
)

POSITION_ONLY = 0x0DFC
"""Type mask 3580: only x and y are used."""
VELOCITY_AND_YAW_RATE = 1511
"""Type mask. With a yaw rate, a negative speed means backwards; without, the rover turns round first (measured)."""
YAW_ONLY = 2559
"""Type mask: only the yaw is used."""
KEEP_THROTTLE = -1.0
FILE_BYTES = 251


LongCommand = SetMode | Arm | ChangeSpeed | RequestRate | RequestMessage | RunPrearmChecks
"""Commands sent as COMMAND_LONG."""


class EncodeError(Exception):
    """A command that cannot be encoded yet in the chosen form."""


class Encoder:
    """Encodes packets with one system and component id and rising sequence numbers."""

    def __init__(self, setpoint_form: str, component_id: int, signer: Signer | None = None) -> None:
        self._form = setpoint_form
        self._mav: Any = mavlink.MAVLink(None)
        self._mav.srcComponent = component_id
        self._signer = signer
        if signer is not None:
            self._mav.signing.secret_key = signer.key
            self._mav.signing.sign_outgoing = True
        self._text_id = 0
        self._system_id = 1
        self._boot_ms = 0

    def encode(
        self, command: Command, system_id: int, boot_ms: int, origin: GeoPoint | None, confirmation: int = 0
    ) -> list[bytes]:
        """The packets of a command. ``confirmation`` counts repetitions.

        Raises EncodeError for a position in degrees while the EKF origin is unknown.
        """
        self._system_id, self._boot_ms = system_id, boot_ms
        self._mav.srcSystem = system_id
        return [self._packed(message) for message in self._messages(command, origin, confirmation)]

    def _packed(self, message: Any) -> bytes:
        if self._signer is not None:
            self._mav.signing.timestamp = self._signer.next_timestamp()
        raw = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw

    def _messages(self, command: Command, origin: GeoPoint | None, confirmation: int) -> list[Any]:
        match command:
            case Heartbeat():
                return [_heartbeat()]
            case GuidedPosition():
                return [self._position(command.point, origin)]
            case GuidedVelocity():
                return [self._velocity(command)]
            case GuidedHeading():
                return [self._heading(command)]
            case ReadParameter():
                return [self._read(command)]
            case TimeSync():
                return [mavlink.MAVLink_timesync_message(0, command.asked_ns)]
            case StatusText():
                return self._text(command)
            case RequestList() | RequestItem() | EndTransfer() | FileRequest():
                return [self._transfer(command)]
            case AnswerRequest() | RunCommand():
                return [answer_message(command) if isinstance(command, AnswerRequest) else self._run_command(command)]
            case ParameterValue():
                return [_parameter_value(command)]
            case NamedValue():
                name = command.name.encode("ascii")
                return [mavlink.MAVLink_named_value_float_message(self._boot_ms, name, command.value)]
            case _:
                return [self._command_long(command, confirmation)]

    def _command_long(self, command: LongCommand, again: int) -> Any:
        first, second, third = _parameters(command)
        number = command_number(command)
        return mavlink.MAVLink_command_long_message(
            self._system_id, 1, number, again, first, second, third, 0.0, 0.0, 0.0, 0.0
        )

    def _run_command(self, command: RunCommand) -> Any:
        """As COMMAND_INT with a place, whose degrees a float could not hold. What is not given is 0, or NaN where 0
        would be an order: an angle or a rate of a gimbal."""
        missing = math.nan if command.number == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW else 0.0
        first = [missing if value is None else value for value in command.params[:4]]
        rest = [0.0 if value is None else value for value in command.params[4:]]
        to = (self._system_id, 1)
        if command.place is None:
            return mavlink.MAVLink_command_long_message(*to, command.number, command.repetition, *first, *rest)
        lat_e7, lon_e7 = (round(value * 1e7) for value in command.place)
        return mavlink.MAVLink_command_int_message(
            *to, command.frame, command.number, 0, 0, *first, lat_e7, lon_e7, rest[2]
        )

    def _position(self, point: NedPoint, origin: GeoPoint | None) -> Any:
        if self._form == "local":
            return self._local_target(
                mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY, north_m=point.north_m, east_m=point.east_m
            )
        if origin is None:
            raise EncodeError(f"setpoint form '{self._form}' needs the EKF origin, which is not known yet")
        geo = LocalFrame(origin).to_geo(point)
        lat_e7, lon_e7 = round(geo.lat_deg * 1e7), round(geo.lon_deg * 1e7)
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        if self._form == "global":
            return mavlink.MAVLink_set_position_target_global_int_message(
                self._boot_ms, self._system_id, 1, frame, POSITION_ONLY, lat_e7, lon_e7, *[0.0] * 9
            )
        if self._form == "mission-item":
            waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
            return mavlink.MAVLink_mission_item_int_message(
                self._system_id, 1, 0, frame, waypoint, GUIDED_ITEM, 0, *[0.0] * 4, lat_e7, lon_e7, 0.0
            )
        # The flag that switches to GUIDED stays 0: only a person or the start-up sets the mode.
        reposition = mavlink.MAV_CMD_DO_REPOSITION
        return mavlink.MAVLink_command_int_message(
            self._system_id, 1, frame, reposition, 0, 0, KEEP_SPEED, 0.0, 0.0, 0.0, lat_e7, lon_e7, 0.0
        )

    def _velocity(self, command: GuidedVelocity) -> Any:
        return self._local_target(
            mavlink.MAV_FRAME_BODY_NED,
            VELOCITY_AND_YAW_RATE,
            forward_m_s=command.forward_m_s,
            yaw_rate_rad_s=command.yaw_rate_rad_s,
        )

    def _heading(self, command: GuidedHeading) -> Any:
        return self._local_target(mavlink.MAV_FRAME_LOCAL_NED, YAW_ONLY, yaw_rad=command.heading_rad)

    def _local_target(
        self,
        frame: int,
        mask: int,
        *,
        north_m: float = 0.0,
        east_m: float = 0.0,
        forward_m_s: float = 0.0,
        yaw_rad: float = 0.0,
        yaw_rate_rad_s: float = 0.0,
    ) -> Any:
        position, velocity = (north_m, east_m, 0.0), (forward_m_s, 0.0, 0.0)
        return mavlink.MAVLink_set_position_target_local_ned_message(
            self._boot_ms, self._system_id, 1, frame, mask, *position, *velocity, 0.0, 0.0, 0.0, yaw_rad, yaw_rate_rad_s
        )

    def _read(self, command: ReadParameter) -> Any:
        return mavlink.MAVLink_param_request_read_message(self._system_id, 1, command.name.encode("ascii"), -1)

    def _transfer(self, command: RequestList | RequestItem | EndTransfer | FileRequest) -> Any:
        to = (self._system_id, 1)
        match command:
            case RequestList():
                return mavlink.MAVLink_mission_request_list_message(*to, int(command.kind))
            case RequestItem():
                return mavlink.MAVLink_mission_request_int_message(*to, command.index, int(command.kind))
            case FileRequest():
                return mavlink.MAVLink_file_transfer_protocol_message(0, *to, command.payload.ljust(FILE_BYTES, b"\0"))
            case _:
                result = mavlink.MAV_MISSION_OPERATION_CANCELLED if command.cancelled else mavlink.MAV_MISSION_ACCEPTED
                return mavlink.MAVLink_mission_ack_message(*to, result, int(command.kind))

    def _text(self, command: StatusText) -> list[Any]:
        chunks = chunks_of(command.text)
        if len(chunks) == 1:
            return [mavlink.MAVLink_statustext_message(command.severity, chunks[0])]
        self._text_id = self._text_id % 65535 + 1
        return [
            mavlink.MAVLink_statustext_message(command.severity, chunk, self._text_id, number)
            for number, chunk in enumerate(chunks)
        ]


def _heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def _parameter_value(command: ParameterValue) -> Any:
    """Whole numbers are sent as float values, as ArduPilot does, not as their bytes."""
    kind = mavlink.MAV_PARAM_TYPE_INT32 if command.whole_number else mavlink.MAV_PARAM_TYPE_REAL32
    name = command.name.encode("ascii")
    return mavlink.MAVLink_param_value_message(name, command.value, kind, command.count, command.index)


def command_number(command: Command) -> int | None:
    """The MAV_CMD of a command that is answered by COMMAND_ACK; None for other commands."""
    match command:
        case SetMode():
            return int(mavlink.MAV_CMD_DO_SET_MODE)
        case Arm():
            return int(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
        case ChangeSpeed():
            return int(mavlink.MAV_CMD_DO_CHANGE_SPEED)
        case RequestRate():
            return int(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
        case RunPrearmChecks():
            return int(mavlink.MAV_CMD_RUN_PREARM_CHECKS)
        case RequestMessage():
            return int(mavlink.MAV_CMD_REQUEST_MESSAGE)
        case _:
            return None


def _parameters(command: LongCommand) -> tuple[float, float, float]:
    """The first three parameters of COMMAND_LONG."""
    match command:
        case RunPrearmChecks():
            return 0.0, 0.0, 0.0
        case SetMode():
            return float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(command.mode), 0.0
        case Arm():
            return 1.0, 0.0, 0.0
        case ChangeSpeed():
            return float(mavlink.SPEED_TYPE_GROUNDSPEED), command.speed_m_s, KEEP_THROTTLE
        case RequestRate():
            # Interval in microseconds; -1 switches the stream off.
            interval = round(1e6 / command.rate_hz) if command.rate_hz > 0.0 and math.isfinite(command.rate_hz) else -1
            return float(command.message_id), float(interval), 0.0
        case RequestMessage():
            return float(command.message_id), 0.0, 0.0
