"""ArduRover's face: takes in packets, keeps to its start-up timetable, sends what is due."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.boot import HOME_S, ORIGIN_S, POSITION_S
from sitl.autopilot.commands import answer
from sitl.autopilot.control import LOOP_HZ
from sitl.autopilot.files import answer_file_request
from sitl.autopilot.link import Channel
from sitl.autopilot.modes import apply_sticks, run_failsafes, set_mode
from sitl.autopilot.network import close_channel, open_channel, pass_on, set_up_signing
from sitl.autopilot.params import REAL32
from sitl.autopilot.progress import plan_due_us, run_plan, set_mission_current
from sitl.autopilot.proximity import forget_stale, take_in
from sitl.autopilot.signing import SECURE_PORT
from sitl.autopilot.streams import send_due, set_group
from sitl.autopilot.targets import attitude_target, global_target, local_target
from sitl.autopilot.telemetry import heartbeat
from sitl.autopilot.transfer import TRANSFERS, keep_home
from sitl.autopilot.vehicle import ALTITUDE_M, INFO, WARNING, Sticks, Vehicle, parameter_message

PARAMETERS_PER_LOOP = 5
TIMESYNC_S = 10.0
UNCHANGED, RELEASED = 65535, 32767

TIMETABLE: tuple[tuple[float, tuple[str, ...]], ...] = (
    (0.0, ("Calibrating barometer", "Barometer 1 calibration complete", "Barometer 2 calibration complete")),
    (1.0, ("Beginning INS calibration. Do not move vehicle", "ArduPilot Ready", "AHRS: DCM active")),
    (4.0, ("EKF3 IMU0 initialised", "EKF3 IMU1 initialised")),
    (5.0, ("EKF3 IMU0 tilt alignment complete", "EKF3 IMU1 tilt alignment complete")),
    (6.0, ("EKF3 IMU0 MAG0 initial yaw alignment complete", "EKF3 IMU1 MAG0 initial yaw alignment complete")),
    (9.0, ("GPS 1: probing for u-blox at 230400 baud", "GPS 1: detected u-blox")),
    (HOME_S, ()),
    (ORIGIN_S, ("EKF3 IMU0 origin set", "EKF3 IMU1 origin set", f"Field Elevation Set: {ALTITUDE_M:.0f}m")),
    (POSITION_S, ("EKF3 IMU0 is using GPS", "EKF3 IMU1 is using GPS", "AHRS: EKF3 active")),
)
"""What is said when, seconds since boot (measured)."""


class Autopilot:
    """Packets in, packets out, one main loop at a time; motion itself is in the vehicle's compiled records."""

    def __init__(self, vehicle: Vehicle) -> None:
        """An autopilot that has just been booted."""
        self.vehicle = vehicle
        self._opened = 0
        self._next_event = 0
        self._next_second_us = 0

    def open_channel(self, port: int = SECURE_PORT) -> Channel:
        """A new connection through a serial port; it is streamed to at once."""
        self._opened += 1
        return open_channel(self.vehicle, self._opened - 1, port)

    def close_channel(self, channel: Channel) -> None:
        """Forget a connection and who was heard there."""
        close_channel(self.vehicle, channel)
        if self.vehicle.plan.helper is not None and self.vehicle.plan.helper[2] == channel.number:
            self.vehicle.plan.helper = None

    def receive(self, channel: Channel, data: bytes) -> None:
        """Handle what arrived on a channel."""
        for message in channel.parse(data):
            handler = HANDLERS.get(message.get_type())
            if pass_on(self.vehicle, channel, message) and handler is not None:
                handler(self.vehicle, channel, message)
        self.vehicle.flush_texts()

    def next_due_us(self) -> float:
        """When something must be sent or said next."""
        due_us = float(self._next_second_us)
        if self._next_event < len(TIMETABLE):
            due_us = min(due_us, self._event_s() * 1e6)
        due_us = min(due_us, plan_due_us(self.vehicle))
        for channel in self.vehicle.channels.values():
            if channel.requested or channel.parameter_queue:
                return 0.0
            if channel.due_us:
                due_us = min(due_us, *channel.due_us.values())
        return due_us

    def run_due(self) -> None:
        """Say and send what is due, tell of targets reached and of time-outs."""
        vehicle = self.vehicle
        self._report_motion()
        self._follow_timetable()
        run_plan(vehicle)
        if vehicle.time_us >= self._next_second_us:
            self._next_second_us += 1_000_000
            run_failsafes(vehicle)
            forget_stale(vehicle)
            vehicle.signing.save([channel.codec for channel in vehicle.channels.values()], vehicle.time_s)
            for channel in vehicle.channels.values():
                for message in heartbeat(vehicle):
                    channel.send(message)
                if channel.spoken and vehicle.time_s % TIMESYNC_S < 1.0:
                    channel.send(mavlink.MAVLink_timesync_message(0, vehicle.time_us * 1000))
        for channel in vehicle.channels.values():
            send_due(vehicle, channel)
            for name in channel.parameter_queue[:PARAMETERS_PER_LOOP]:
                channel.send(parameter_message(vehicle.parameters, name, in_list=True))
            del channel.parameter_queue[:PARAMETERS_PER_LOOP]
        vehicle.flush_texts()

    def _report_motion(self) -> None:
        vehicle, control = self.vehicle, self.vehicle.control
        if control[0]["arrived"]:
            control["arrived"] = 0
            if vehicle.in_guided:
                for channel in vehicle.channels.values():
                    channel.send(mavlink.MAVLink_mission_item_reached_message(0))
        if control[0]["timed_out"]:
            control["timed_out"] = 0
            vehicle.say(WARNING, f"target not received last {vehicle.parameters['GUID_TIMEOUT']:.0f}secs, stopping")

    def _event_s(self) -> float:
        """When the next event of the timetable is, which for some is later when the GPS is."""
        moment_s, late = TIMETABLE[self._next_event][0], self.vehicle.gps_late
        return moment_s + {HOME_S: late.home_s, ORIGIN_S: late.origin_s, POSITION_S: late.position_s}.get(moment_s, 0.0)

    def _follow_timetable(self) -> None:
        vehicle = self.vehicle
        while self._next_event < len(TIMETABLE) and vehicle.time_s >= self._event_s():
            moment_s, texts = TIMETABLE[self._next_event]
            self._next_event += 1
            for text in texts:
                vehicle.say(INFO, text)
            if moment_s == HOME_S:
                keep_home(vehicle)
                for channel in vehicle.channels.values():
                    channel.requested.append(mavlink.MAVLINK_MSG_ID_HOME_POSITION)


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
        return  # without a word: no such name, or no number
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
        who, known = (message.get_srcSystem(), message.get_srcComponent()), vehicle.plan.helper
        if known is None or known[:2] == who:
            vehicle.plan.helper = (*who, channel.number)


def _override(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """RC_CHANNELS_OVERRIDE of the ground station: steering and throttle; 0 lets go, 65535 leaves as it is."""
    sticks = vehicle.sticks
    steering, throttle = (
        before if raw_us == UNCHANGED else None if raw_us == 0 else (raw_us - 1500) / 500.0
        for raw_us, before in ((message.chan1_raw, sticks.steering), (message.chan3_raw, sticks.throttle))
    )
    _take_sticks(vehicle, message, steering, throttle)


def _manual_control(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MANUAL_CONTROL, a joystick: y steers, z is the throttle, in thousandths; the largest number lets go."""
    if message.target == vehicle.system:
        axes = (None if axis == RELEASED else axis / 1000.0 for axis in (message.y, message.z))
        _take_sticks(vehicle, message, *axes)


def _take_sticks(vehicle: Vehicle, message: Any, steering: float | None, throttle: float | None) -> None:
    """The ground station's sticks, -1 to 1, None where it lets go. They are a sign of life as well."""
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


def _local(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    local_target(vehicle, message)


def _global(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    global_target(vehicle, message)


def _obstacles(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    take_in(vehicle, message)


def _attitude(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    attitude_target(vehicle, message)


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
    "SET_ATTITUDE_TARGET": _attitude,
    "SET_MODE": _old_set_mode,
    "SET_POSITION_TARGET_GLOBAL_INT": _global,
    "SET_POSITION_TARGET_LOCAL_NED": _local,
    "SETUP_SIGNING": set_up_signing,
    "TIMESYNC": _timesync,
    **TRANSFERS,
}
"""Everything else is taken in and ignored."""

__all__ = ["LOOP_HZ", "REAL32", "Autopilot"]
