"""ArduRover in Python: the main loop that handles packets, runs the modes and sends what is due."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.channel import Channel
from sitl.autopilot.fence import run_fence
from sitl.autopilot.guard import guard_of
from sitl.autopilot.links import close_channel, forward, open_channel
from sitl.autopilot.messages import HANDLERS
from sitl.autopilot.mission_protocol import keep_home, run_uploads
from sitl.autopilot.mode_auto import run_auto
from sitl.autopilot.mode_rtl import run_return
from sitl.autopilot.mode_smart_rtl import SAVE_EVERY_US, remember_path, run_smart_rtl
from sitl.autopilot.modes import disarm, run_failsafes, set_mode
from sitl.autopilot.proximity import forget_stale
from sitl.autopilot.signing import SECURE_PORT
from sitl.autopilot.start_up import HOME_S, ORIGIN_S, POSITION_S, TIMETABLE
from sitl.autopilot.state import Mode
from sitl.autopilot.streams import send_due
from sitl.autopilot.telemetry import heartbeat
from sitl.autopilot.vehicle import Vehicle, parameter_message

PARAMETERS_PER_LOOP = 5
TIMESYNC_S = 10.0
TICK_US = 100_000
"""Interval at which the modes are run; an arrival is noticed at once."""

BUSY_MODES = {Mode.AUTO, Mode.RTL, Mode.SMART_RTL}


class Autopilot:
    """Handles packets and sends what is due; the motion itself is computed by compiled code in ``control``."""

    def __init__(self, vehicle: Vehicle) -> None:
        """An autopilot that has just booted."""
        self.vehicle = vehicle
        self._guard = guard_of(vehicle, set_mode)
        self._opened = 0
        self._next_event = 0
        self._next_second_us = 0

    def open_channel(self, port: int = SECURE_PORT) -> Channel:
        """Open a channel through a serial port; streams start at once."""
        self._opened += 1
        return open_channel(self.vehicle, self._opened - 1, port)

    def close_channel(self, channel: Channel) -> None:
        """Close a channel and forget its routes."""
        close_channel(self.vehicle, channel)
        if self.vehicle.onboard_controller is not None and self.vehicle.onboard_controller[2] == channel.number:
            self.vehicle.onboard_controller = None

    def receive(self, channel: Channel, data: bytes) -> None:
        """Handle bytes that arrived on a channel."""
        for message in channel.parse(data):
            handler = HANDLERS.get(message.get_type())
            if self._guard is not None:
                self._guard.hear(message)
            if forward(self.vehicle, channel, message) and handler is not None:
                handler(self.vehicle, channel, message)
        if self._guard is not None:
            self._guard.run()
        self.vehicle.flush_texts()

    def next_due_us(self) -> float:
        """Time of the next message or text that is due."""
        due_us = float(self._next_second_us)
        if self._next_event < len(TIMETABLE):
            due_us = min(due_us, self._event_s() * 1e6)
        due_us = min(due_us, modes_due_us(self.vehicle))
        if self._guard is not None:
            due_us = min(due_us, self._guard.due_us())
        for channel in self.vehicle.channels.values():
            if channel.requested or channel.parameter_queue:
                return 0.0
            if channel.due_us:
                due_us = min(due_us, *channel.due_us.values())
        return due_us

    def run_due(self) -> None:
        """Run the modes, report arrivals and time-outs, send what is due."""
        vehicle = self.vehicle
        self._report_motion()
        self._follow_timetable()
        run_modes(vehicle)
        if self._guard is not None:
            self._guard.run()
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
        if control["arrived"][0]:
            control["arrived"] = 0
            if vehicle.in_guided:
                for channel in vehicle.channels.values():
                    channel.send(mavlink.MAVLink_mission_item_reached_message(0))
        if control["timed_out"][0]:
            control["timed_out"] = 0
            limit_s = vehicle.parameters["GUID_TIMEOUT"]
            vehicle.say(Severity.WARNING, f"target not received last {limit_s:.0f}secs, stopping")

    def _event_s(self) -> float:
        """Time of the next event of the start-up; some are delayed without GPS."""
        moment_s, late = TIMETABLE[self._next_event][0], self.vehicle.gps_late
        return moment_s + {HOME_S: late.home_s, ORIGIN_S: late.origin_s, POSITION_S: late.position_s}.get(moment_s, 0.0)

    def _follow_timetable(self) -> None:
        vehicle = self.vehicle
        while self._next_event < len(TIMETABLE) and vehicle.time_s >= self._event_s():
            moment_s, texts = TIMETABLE[self._next_event]
            self._next_event += 1
            for text in texts:
                vehicle.say(Severity.INFO, text)
            if moment_s == HOME_S:
                keep_home(vehicle)
                for channel in vehicle.channels.values():
                    channel.requested.append(mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def run_modes(vehicle: Vehicle) -> None:
    """Run uploads, fence and the present mode for this moment."""
    now_us = vehicle.time_us
    if vehicle.uploads:
        run_uploads(vehicle)
    if vehicle.fence.enabled or vehicle.parameters["FENCE_ENABLE"] != vehicle.fence.seen_setting:
        run_fence(vehicle, set_mode, disarm)
    if now_us >= vehicle.smart_rtl.due_us:
        vehicle.smart_rtl.due_us = (now_us // SAVE_EVERY_US + 1) * SAVE_EVERY_US
        remember_path(vehicle)
    if vehicle.mode == Mode.AUTO:
        run_auto(vehicle)
    elif vehicle.mode == Mode.RTL:
        run_return(vehicle)
    elif vehicle.mode == Mode.SMART_RTL:
        run_smart_rtl(vehicle)


def modes_due_us(vehicle: Vehicle) -> float:
    """When ``run_modes`` is to be called next."""
    if vehicle.uploads or vehicle.fence.enabled or vehicle.mode in BUSY_MODES:
        # In step with the streams, so that both are done together.
        return min(vehicle.smart_rtl.due_us, (vehicle.time_us // TICK_US + 1) * TICK_US)
    return vehicle.smart_rtl.due_us
