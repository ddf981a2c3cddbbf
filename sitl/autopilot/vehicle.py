"""The vehicle's state that all parts of the autopilot share: records of the compiled loop, mode, position, who listens."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.battery import Battery, rest_volts
from sitl.autopilot.channel import Channel
from sitl.autopilot.control.records import (
    CIRCLE,
    LEG,
    LOOP_HZ,
    WAYPOINT,
    MotionRecords,
    Record,
    new_control,
    new_estimate,
    new_tuning,
)
from sitl.autopilot.ekf import Ekf
from sitl.autopilot.mission import Mission
from sitl.autopilot.parameters import Parameters
from sitl.autopilot.routing import Router
from sitl.autopilot.signing import Signing
from sitl.autopilot.start_up import ATTITUDE_S, HOME_S, ORIGIN_S, POSITION_S, GpsLate
from sitl.autopilot.state import (
    DRIVEN_MODES,
    AutoState,
    Clocks,
    FenceState,
    Mode,
    Proximity,
    SmartRtl,
    Sticks,
    Storage,
    Submode,
    Upload,
)
from sitl.sensors.range_sensors import RangeSensing
from sitl.world import geodesy

MOST_TEXTS = 30
"""Texts that wait to be sent; more push the oldest ones out, as in the firmware's queue."""

EKF_UNINITIALISED, EKF_CONSTANT_POSITION = 1024, 167
"""EKF_STATUS_REPORT flags of the start-up: nothing yet; attitude and velocity but a constant position."""

CRITICAL, ERROR, WARNING, NOTICE, INFO = 2, 3, 4, 5, 6
"""MAV_SEVERITY of what is said."""


class Vehicle:
    """State of the simulated ArduRover since it was booted."""

    def __init__(
        self,
        rover: Record,
        origin: tuple[int, int],
        origin_m: tuple[float, float],
        sensing: RangeSensing,
        parameters: Mapping[str, float],
        storage: Storage | None = None,
        kept: Mapping[str, int] | None = None,
    ) -> None:
        """``origin``: where it boots, 1e-7 degree; ``origin_m``: the same place in the world frame.

        ``storage``: missions and fences kept over a reboot; ``kept``: parameters without effect, and their types.
        """
        self.rover = rover
        self.sensing = sensing
        self.parameters = Parameters(parameters, kept)
        self.estimate: Record = new_estimate()
        self.control: Record = new_control()
        self.tuning: Record = new_tuning(self.parameters.as_dict())
        self.records = MotionRecords(self.estimate, self.control, self.tuning)
        self.origin = origin
        self.origin_m = np.array(origin_m)
        self.home = origin
        self.mode = Mode.MANUAL
        self.armed = False
        self.system = min(max(int(self.parameters["MAV_SYSID"]), 1), 255)
        self.channels: dict[int, Channel] = {}
        self.router = Router()
        self.signing = Signing()
        self.clocks = Clocks()
        self.texts: list[tuple[int, str]] = []
        self.rebooting = False
        self.destination: tuple[int, int] = origin
        self.proximity = Proximity()
        self.ekf = Ekf()
        self.battery = Battery()
        self.transmitter = Sticks()
        self.sticks = self.transmitter
        self.gps_late = GpsLate()
        self.stale_m: tuple[float, float] | None = None
        """The last position that was known, while none is; it is told again and again."""
        self.control["rest_v"] = self.parameters["SIM_BATT_VOLTAGE"]
        self.storage = storage or Storage()
        self.mission = Mission(self.storage.mission)
        self.uploads: dict[int, Upload] = {}
        """Transfers under way, by MAV_MISSION_TYPE."""
        self.auto = AutoState()
        self.fence = FenceState()
        self.smart_rtl = SmartRtl()
        self.rtl_arrival_said = False
        self.complaints: set[tuple[int, str]] = set()
        """Complaints about a transfer that were made already: type of list, text."""
        self.onboard_controller: tuple[int, int, int] | None = None
        """The first onboard controller that was heard: system, component, channel."""

    @property
    def time_us(self) -> int:
        """Microseconds since boot."""
        return max(int(self.control[0]["tick"]), 0) * (1_000_000 // LOOP_HZ)

    @property
    def time_s(self) -> float:
        """Seconds since boot."""
        return self.time_us * 1e-6

    @property
    def has_home(self) -> bool:
        """GPS fix and home are there."""
        return self.time_s >= HOME_S + self.gps_late.home_s

    @property
    def has_origin(self) -> bool:
        """The EKF has an origin."""
        return self.time_s >= ORIGIN_S + self.gps_late.origin_s

    @property
    def is_started(self) -> bool:
        """The start-up is over: the EKF has had an absolute position."""
        return self.time_s >= POSITION_S + self.gps_late.position_s

    @property
    def has_position(self) -> bool:
        """The EKF has an absolute position."""
        return self.is_started and self.ekf.has_position

    @property
    def ekf_flags(self) -> int:
        """EKF_STATUS_REPORT's flags at this moment."""
        if self.is_started:
            return self.ekf.flags
        if self.time_s >= ATTITUDE_S:
            return EKF_CONSTANT_POSITION
        return 0 if self.time_s >= ATTITUDE_S - 1.0 else EKF_UNINITIALISED

    @property
    def in_guided(self) -> bool:
        """Guided targets are obeyed: in GUIDED, and in AUTO while a mission item hands over."""
        return self.mode == Mode.GUIDED or (self.mode == Mode.AUTO and self.auto.submode == Submode.GUIDED)

    @property
    def has_target(self) -> bool:
        """A place is being driven to, or was reached."""
        if self.mode in (Mode.RTL, Mode.SMART_RTL, Mode.LOITER):
            return True
        return self.mode in DRIVEN_MODES and int(self.control[0]["task"]) in (WAYPOINT, CIRCLE, LEG)

    def position_m(self) -> tuple[float, float]:
        """Estimated metres north and east of the EKF origin; zeros before there is a position, later the last one known."""
        if not self.is_started:
            return 0.0, 0.0
        if self.stale_m is not None:
            return self.stale_m
        believed = self.estimate[0]
        return float(believed["north_m"]), float(believed["east_m"])

    def velocity_m_s(self) -> tuple[float, float]:
        """Estimated speed north and east; zeros without a position."""
        if not self.is_started or self.stale_m is not None:
            return 0.0, 0.0
        believed = self.estimate[0]
        return float(believed["vel_n"]), float(believed["vel_e"])

    def place(self) -> tuple[int, int]:
        """Estimated latitude and longitude, 1e-7 degree; zeros without a fix."""
        if not self.has_home:
            return 0, 0
        return geodesy.moved(self.origin, *self.position_m())

    def gps_place(self) -> tuple[int, int]:
        """Latitude and longitude as the GPS receiver has it, 1e-7 degree; zeros without a fix."""
        error_n, error_e = self.ekf.gps.error_m
        believed = self.estimate[0]
        believed_n, believed_e = float(believed["offset_n"]), float(believed["offset_e"])
        if (error_n, error_e) == (believed_n, believed_e) and self.stale_m is None:
            return self.place()
        if not self.has_home:
            return 0, 0
        north_m, east_m = (float(believed[name]) if self.is_started else 0.0 for name in ("north_m", "east_m"))
        return geodesy.moved(self.origin, north_m + error_n - believed_n, east_m + error_e - believed_e)

    def amps(self) -> float:
        """What the motors take from the battery."""
        return float(self.control[0]["amps"])

    def volts(self) -> float:
        """The battery's voltage."""
        return self.battery.volts(self.parameters, float(self.rover[0]["drawn_ah"]), self.amps())

    def used_mah(self) -> float:
        """What the battery monitor has counted since boot."""
        return float(self.control[0]["used_mah"])

    def battery_percent(self) -> int:
        """What the battery monitor believes is left, by the capacity it was told."""
        capacity_mah = self.parameters["BATT_CAPACITY"]
        if capacity_mah <= 10.0:
            return 0
        return min(max(int(100.0 * (capacity_mah - self.used_mah()) / capacity_mah), 0), 100)

    def drain(self) -> None:
        """Keep the voltage at rest that the compiled loop counts energy with."""
        self.control["rest_v"] = rest_volts(self.parameters, float(self.rover[0]["drawn_ah"]))

    def heading_rad(self) -> float:
        """Estimated heading, -pi to pi."""
        return float(self.estimate[0]["heading_rad"])

    def heading_cdeg(self) -> int:
        """Estimated heading in hundredths of a degree, 0 to 35999."""
        return round(math.degrees(self.heading_rad()) * 100.0) % 36000

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT for every channel; it goes out after the answers of this moment."""
        self.texts.append((severity, text))
        del self.texts[:-MOST_TEXTS]

    def flush_texts(self) -> None:
        """Send the queued texts, longer ones in chunks of 50 characters."""
        for severity, text in self.texts:
            for channel in self.channels.values():
                for message in text_messages(channel, severity, text):
                    channel.send(message)
        self.texts.clear()

    def move_home(self, place: tuple[int, int]) -> None:
        """Home is elsewhere from now on, 1e-7 degree; every channel is told."""
        self.home = place
        for channel in self.channels.values():
            channel.requested.append(mavlink.MAVLINK_MSG_ID_HOME_POSITION)

    def tell_parameter(self, name: str) -> None:
        """Tell every channel a parameter's value."""
        for channel in self.channels.values():
            channel.send(parameter_message(self.parameters, name))

    def retune(self) -> None:
        """Take changed parameters over into the compiled controllers."""
        fresh = new_tuning(self.parameters.as_dict())
        self.tuning[:] = fresh


def parameter_message(table: Parameters, name: str, in_list: bool = False) -> Any:
    """PARAM_VALUE of a known parameter; the index is only told in a list."""
    index = table.index_of(name) if in_list else 65535
    return mavlink.MAVLink_param_value_message(name.encode(), table[name], table.type_of(name), len(table), index)


def text_messages(channel: Channel, severity: int, text: str) -> list[Any]:
    """A text as STATUSTEXT messages."""
    if len(text) <= 50:
        return [mavlink.MAVLink_statustext_message(severity, text.encode(), 0, 0)]
    channel.text_id = channel.text_id % 65535 + 1
    pieces = [text[start : start + 50] for start in range(0, len(text), 50)]
    return [
        mavlink.MAVLink_statustext_message(severity, piece.encode(), channel.text_id, number)
        for number, piece in enumerate(pieces)
    ]
