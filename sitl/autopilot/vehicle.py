"""The state of the simulated ArduRover that all parts of the autopilot share: records, mode, position, channels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
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
    CommandLog,
    CommandTrouble,
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
"""Length of the queue of texts; when it is full the oldest are dropped, as in the firmware."""

EKF_UNINITIALISED, EKF_CONSTANT_POSITION = 1024, 167
"""EKF_STATUS_REPORT flags during the start-up: not initialised; attitude and velocity with a constant position."""


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

        ``storage``: mission, fence and rally points from before a reboot; ``kept``: types of parameters without
        effect.
        """
        self.rover = rover
        self.sensing = sensing
        self.parameters = Parameters(parameters, kept)
        self.estimate: Record = new_estimate()
        self.control: Record = new_control()
        self._tick = self.control["tick"]  # a view: to read it from the record takes nearly three times as long
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
        self.texts: list[tuple[Severity, str]] = []
        self.rebooting = False
        self.destination: tuple[int, int] = origin
        self.proximity = Proximity()
        self.ekf = Ekf()
        self.battery = Battery()
        self.transmitter = Sticks()
        self.sticks = self.transmitter
        self.gps_late = GpsLate()
        self.stale_m: tuple[float, float] | None = None
        """The last known position while there is none; it is reported repeatedly."""
        self.control["rest_v"] = self.parameters["SIM_BATT_VOLTAGE"]
        self.storage = storage or Storage()
        self.mission = Mission(self.storage.mission)
        self.uploads: dict[int, Upload] = {}
        """Transfers under way, by MAV_MISSION_TYPE."""
        self.auto = AutoState()
        self.fence = FenceState()
        self.smart_rtl = SmartRtl()
        self.rtl_arrival_said = False
        self.command_log = CommandLog()
        self.command_troubles: list[CommandTrouble] = []
        """What befalls commands now."""
        self.complaints: set[tuple[int, str]] = set()
        """Complaints about a transfer that were made already: type of list, text."""
        self.onboard_controller: tuple[int, int, int] | None = None
        """The first onboard controller that was heard: system, component, channel."""

    @property
    def time_us(self) -> int:
        """Microseconds since boot."""
        return max(int(self._tick.item()), 0) * (1_000_000 // LOOP_HZ)

    @property
    def time_s(self) -> float:
        """Seconds since boot."""
        return self.time_us * 1e-6

    @property
    def has_home(self) -> bool:
        """Whether there is a GPS fix and home is set."""
        return self.time_s >= HOME_S + self.gps_late.home_s

    @property
    def has_origin(self) -> bool:
        """Whether the EKF has an origin."""
        return self.time_s >= ORIGIN_S + self.gps_late.origin_s

    @property
    def is_started(self) -> bool:
        """Whether the start-up is over: the EKF has had an absolute position."""
        return self.time_s >= POSITION_S + self.gps_late.position_s

    @property
    def has_position(self) -> bool:
        """Whether the EKF has an absolute position now."""
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
        """Whether guided targets are accepted: in GUIDED, and in AUTO during NAV_GUIDED_ENABLE."""
        return self.mode == Mode.GUIDED or (self.mode == Mode.AUTO and self.auto.submode == Submode.GUIDED)

    @property
    def has_target(self) -> bool:
        """Whether there is a destination, reached or not."""
        if self.mode in (Mode.RTL, Mode.SMART_RTL, Mode.LOITER):
            return True
        return self.mode in DRIVEN_MODES and int(self.control["task"][0]) in (WAYPOINT, CIRCLE, LEG)

    def position_m(self) -> tuple[float, float]:
        """Estimated metres north and east of the EKF origin; zeros in the start-up, the last known when lost."""
        if not self.is_started:
            return 0.0, 0.0
        if self.stale_m is not None:
            return self.stale_m
        return float(self.estimate["north_m"][0]), float(self.estimate["east_m"][0])

    def velocity_m_s(self) -> tuple[float, float]:
        """Estimated velocity north and east; zeros without a position."""
        if not self.is_started or self.stale_m is not None:
            return 0.0, 0.0
        return float(self.estimate["vel_n"][0]), float(self.estimate["vel_e"][0])

    def place(self) -> tuple[int, int]:
        """Estimated latitude and longitude, 1e-7 degree; zeros without a fix."""
        if not self.has_home:
            return 0, 0
        return geodesy.moved(self.origin, *self.position_m())

    def gps_place(self) -> tuple[int, int]:
        """The GPS receiver's latitude and longitude, 1e-7 degree; zeros without a fix."""
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
        """Current of the motors."""
        return float(self.control["amps"][0])

    def volts(self) -> float:
        """Voltage of the battery."""
        return self.battery.volts(self.parameters, float(self.rover["drawn_ah"][0]), self.amps())

    def used_mah(self) -> float:
        """Charge used since boot, as the battery monitor counts it."""
        return float(self.control["used_mah"][0])

    def battery_percent(self) -> int:
        """Charge left according to the battery monitor and BATT_CAPACITY."""
        capacity_mah = self.parameters["BATT_CAPACITY"]
        if capacity_mah <= 10.0:
            return 0
        return min(max(int(100.0 * (capacity_mah - self.used_mah()) / capacity_mah), 0), 100)

    def drain(self) -> None:
        """Update the voltage at rest, from which the compiled loop computes the energy used."""
        self.control["rest_v"] = rest_volts(self.parameters, float(self.rover["drawn_ah"][0]))

    def heading_rad(self) -> float:
        """Estimated heading, -pi to pi."""
        return float(self.estimate["heading_rad"][0])

    def heading_cdeg(self) -> int:
        """Estimated heading in hundredths of a degree, 0 to 35999."""
        return round(math.degrees(self.heading_rad()) * 100.0) % 36000

    def say(self, severity: Severity, text: str) -> None:
        """Queue a STATUSTEXT for every channel; it is sent after the answers of this moment."""
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
        """Set home, in 1e-7 degree, and send it on every channel."""
        self.home = place
        for channel in self.channels.values():
            channel.requested.append(mavlink.MAVLINK_MSG_ID_HOME_POSITION)

    def send_parameter(self, name: str) -> None:
        """Send a parameter's value on every channel."""
        for channel in self.channels.values():
            channel.send(parameter_message(self.parameters, name))

    def retune(self) -> None:
        """Copy changed parameters into the tuning record of the compiled controllers."""
        fresh = new_tuning(self.parameters.as_dict())
        self.tuning[:] = fresh


def parameter_message(table: Parameters, name: str, in_list: bool = False) -> Any:
    """PARAM_VALUE of a known parameter; the index is only given in a list."""
    index = table.index_of(name) if in_list else 65535
    return mavlink.MAVLink_param_value_message(name.encode(), table[name], table.type_of(name), len(table), index)


def text_messages(channel: Channel, severity: Severity, text: str) -> list[Any]:
    """A text as STATUSTEXT messages."""
    if len(text) <= 50:
        return [mavlink.MAVLink_statustext_message(severity, text.encode(), 0, 0)]
    channel.text_id = channel.text_id % 65535 + 1
    pieces = [text[start : start + 50] for start in range(0, len(text), 50)]
    return [
        mavlink.MAVLink_statustext_message(severity, piece.encode(), channel.text_id, number)
        for number, piece in enumerate(pieces)
    ]
