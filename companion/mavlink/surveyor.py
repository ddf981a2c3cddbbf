"""Surveys an autopilot: listens and asks, but sends no heartbeat, mode, arming command or setpoint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from companion.mavlink import points, ranges
from companion.mavlink.byte_link import ByteLink
from companion.mavlink.codec import Codec
from companion.mavlink.decode import ROVERS
from companion.mavlink.framing import AUTOPILOT, Packet
from companion.mavlink.points import Band
from companion.mavlink.rates import RateRequester, wanted_rates
from companion.mavlink.serial_port import rivals_of
from companion.mavlink.signing import Signer, remedy
from companion.settings import LinkSettings
from companion.vehicle.commands import Command, ReadParameter, RequestMessage, RunPrearmChecks
from companion.vehicle.events import ParameterSeen, TextSeen
from companion.vehicle.state import VehicleState, fold
from companion.vehicle.survey import Autopilot, RangeSource, SlowMessage, Survey

OTHER_COMPONENT = 192
"""Component id of the surveyor: a running companion must not see a twin.

It sends no heartbeat: the autopilot might hand legs of AUTO over to it.
"""
ASK_S = 1.0
PARAMETER_S = 0.05
"""The time between parameter requests, so that a slow line is not flooded,"""
TRIES = 5
"""and how often an unanswered one is repeated."""
RIVALS_S = 2.0
"""How often it is looked which other programs have the device open."""
MOST_TEXTS, MOST_SOURCES, MOST_SYSTEMS = 32, 64, 32
GEOFENCE = mavlink.MAV_SYS_STATUS_GEOFENCE
ASKED = (
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION,
)


@dataclass(slots=True)
class _Heard:
    """What was heard of a range sensor: since when, its newest message, and how many of them."""

    first_s: float
    message: Any
    count: int = 0
    blind: bool = True


class Surveyor:
    """Call ``step`` some twenty times a second. ``names``: the parameters to ask for."""

    def __init__(
        self, link: ByteLink, settings: LinkSettings, names: Sequence[str], signer: Signer | None = None
    ) -> None:
        self._link = link
        self._companion = settings.component_id
        other = OTHER_COMPONENT + (self._companion == OTHER_COMPONENT)
        self._codec = Codec(
            settings.model_copy(update={"component_id": other}), signer=signer, companion=self._companion
        )
        self._band = Band(settings.points_above_m, settings.points_below_m)
        self._rates = RateRequester(wanted_rates(settings))
        self._mav: Any = mavlink.MAVLink(None)
        self._names = tuple(names)
        self._open = [name for _ in range(TRIES) for name in names]
        self._vehicle = VehicleState()
        self._parameters: dict[str, float] = {}
        self._ask_s = self._parameter_s = -math.inf
        self._first_s: float | None = None
        self._checked = False
        self._autopilots: dict[int, Autopilot] = {}
        self._systems: set[int] = set()
        self._companion_heard = self._breached = False
        self._version: tuple[int, int, int] | None = None
        self._sources: dict[tuple[int, int, int], _Heard] = {}
        self._texts: dict[str, None] = {}
        self._packets = self._bytes = 0
        self._rivals: dict[int, str] = {}
        self._rivals_s = -math.inf
        self._unbelieved: int | None = None
        self._now_s = 0.0

    @property
    def done(self) -> bool:
        """Whether all questions have been asked and rates have been measured twice."""
        return self._first_s is not None and not self._open and self._now_s - self._first_s > 8.0

    def step(self, now_s: float) -> None:
        """Listen, and send the questions that are due."""
        self._now_s = now_s
        data = self._link.read()
        self._bytes += len(data)
        if now_s >= self._rivals_s:
            self._rivals_s = now_s + RIVALS_S
            self._rivals.update((user.pid, str(user)) for user in rivals_of(self._link))
        for packet in self._codec.packets(data):
            self._packets += 1
            if not self._codec.accepts(packet):
                self._overhear(packet)
            else:
                self._read(packet)
                for event in self._codec.decode_packet(packet, now_s):
                    self._vehicle = fold(self._vehicle, event)
                    if isinstance(event, ParameterSeen) and event.name in self._names:
                        self._parameters[event.name] = event.value
                    if (
                        isinstance(event, TextSeen)
                        and event.severity <= Severity.WARNING
                        and len(self._texts) < MOST_TEXTS
                    ):
                        self._texts[event.text] = None
        for command in self._questions(now_s):
            for raw in self._codec.encode_packets(command):
                self._link.write(raw)

    def result(self) -> Survey:
        """The survey so far."""
        counters = self._codec.counters
        slow = tuple(SlowMessage(fault.name, fault.wanted_hz, fault.measured_hz) for fault in self._rates.faults)
        return Survey(
            place=self._link.description,
            system=self._codec.system_id,
            component=self._companion,
            vehicle=self._vehicle,
            rover_heard=self._codec.vehicle_known,
            autopilots=tuple(self._autopilots.values()),
            systems=frozenset(self._systems),
            companion_heard=self._companion_heard,
            version=self._version,
            parameters=dict(self._parameters),
            asked=self._names,
            sources=tuple(self._source(key, seen) for key, seen in self._sources.items()),
            slow=slow,
            texts=tuple(self._texts),
            fence_breached=self._breached,
            signing=self._codec.signing_trouble,
            signing_remedy=remedy(counters.refused),
            unbelieved=self._unbelieved,
            lost=counters.lost,
            packets=self._packets,
            bad_bytes=counters.bad_bytes,
            read_bytes=self._bytes,
            strange=self._codec.strange,
            rivals=tuple(self._rivals.values()),
        )

    # Asking -------------------------------------------------------------------------------------------------------

    def _questions(self, now_s: float) -> list[Command]:
        questions: list[Command] = []
        if now_s - self._ask_s >= ASK_S:
            self._ask_s = now_s
            questions += [RequestMessage(number) for number in ASKED if not self._told(number)]
        if not self._codec.vehicle_known:
            return questions[:1]  # a server sends nothing before it has received a packet
        if self._first_s is None:
            self._first_s = now_s
        questions += self._rates.due(now_s, self._codec.message_counts)
        if not self._checked and self._vehicle.heartbeat is not None and now_s - self._first_s > 2.0:
            self._checked = True
            questions += [] if self._vehicle.heartbeat.armed else [RunPrearmChecks()]
        if now_s - self._parameter_s >= PARAMETER_S - 1e-6:
            while self._open and self._open[0] in self._parameters:
                self._open.pop(0)
            if self._open:
                self._parameter_s = now_s
                questions.append(ReadParameter(self._open.pop(0)))
        return questions

    def _told(self, number: int) -> bool:
        return {
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version is not None,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._vehicle.origin is not None,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._vehicle.home is not None,
        }[number]

    # Listening ----------------------------------------------------------------------------------------------------

    def _read(self, packet: Packet) -> None:
        """Reads what the companion's events do not hold."""
        if len(self._systems) < MOST_SYSTEMS:
            self._systems.add(packet.system_id)
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._heartbeat(packet)
        if packet.system_id != self._codec.system_id or not self._codec.vehicle_known:
            return
        match packet.message_id:
            case number if number in ranges.MESSAGES:
                self._range(packet)
            case mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION if packet.component_id == AUTOPILOT:
                number = self._message(packet).flight_sw_version
                self._version = (number >> 24 & 255, number >> 16 & 255, number >> 8 & 255)
            case mavlink.MAVLINK_MSG_ID_SYS_STATUS if packet.component_id == AUTOPILOT:
                status = self._message(packet)
                watched = status.onboard_control_sensors_enabled & GEOFENCE
                self._breached = bool(watched and not status.onboard_control_sensors_health & GEOFENCE)
            case _:
                pass

    def _overhear(self, packet: Packet) -> None:
        """Notes a rover whose packets are refused."""
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and packet.component_id == AUTOPILOT:
            message = self._message(packet)
            if message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and message.type in ROVERS:
                self._unbelieved = packet.system_id

    def _heartbeat(self, packet: Packet) -> None:
        message = self._message(packet)
        is_autopilot = packet.component_id == AUTOPILOT and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID
        if is_autopilot and len(self._autopilots) < MOST_SYSTEMS:
            self._autopilots[packet.system_id] = Autopilot(packet.system_id, message.type, message.autopilot)
        self._companion_heard |= packet.component_id == self._companion and packet.system_id == self._codec.system_id

    def _range(self, packet: Packet) -> None:
        """Notes a range message; of points with the same time stamp the first counts as the message."""
        message = self._message(packet)
        beams = packet.message_id == mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR
        key = (packet.message_id, packet.component_id, message.id if beams else message.sensor_type)
        if key not in self._sources and len(self._sources) >= MOST_SOURCES:
            return
        seen = self._sources.setdefault(key, _Heard(self._now_s, message))
        new = (
            seen.count == 0 or packet.message_id != points.MESSAGE or message.time_boot_ms != seen.message.time_boot_ms
        )
        seen.count += new
        seen.blind = seen.blind and not self._says_something(message)
        seen.message = message

    def _says_something(self, message: Any) -> bool:
        """Whether a range message holds a reading."""
        match message.get_msgId():
            case points.MESSAGE:
                look = points.look_of(message)
                return look is not None and points.seen_at(message, look, self._band) is not None
            case mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
                return ranges.obstacle_distance(message, self._now_s) is not None
            case _:
                return ranges.distance_sensor(message, self._now_s, sector=False) is not None

    def _source(self, key: tuple[int, int, int], seen: _Heard) -> RangeSource:
        number, component, sensor = key
        message = seen.message
        beam = number == mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR
        unit_m = 1.0 if number == points.MESSAGE else 0.01
        return RangeSource(
            message=message.get_type(),
            component=component,
            sensor=sensor,
            orientation=message.orientation if beam else None,
            min_m=message.min_distance * unit_m,
            max_m=message.max_distance * unit_m,
            rate_hz=(seen.count - 1) / max(self._now_s - seen.first_s, 1e-3),
            sector=beam and component == AUTOPILOT and ranges.is_sector(message),
            blind=seen.blind,
            frame=message.frame if number == points.MESSAGE else None,
        )

    def _message(self, packet: Packet) -> Any:
        return self._mav.decode(bytearray(packet.raw))
