"""Moving obstacles that announce themselves over MAVLink: as vehicles, by ADS-B or by AIS.

A vehicle is a MAVLink system of its own on the same network: HEARTBEAT and GLOBAL_POSITION_INT. ADS-B and AIS reach the
autopilot's receivers by radio, and the autopilot sends them on as ADSB_VEHICLE and AIS_VESSEL.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.channel import new_codec, packed
from sitl.autopilot.routing import AUTOPILOT
from sitl.world import geodesy
from sitl.world.geodesy import ALTITUDE_M
from sitl.world.movers import Announcement
from sitl.world.world import World

FIRST_SYSTEM = 101
"""System id of the first mover that announces itself as a vehicle; the others count on."""

INTERVALS_S = {Announcement.VEHICLE: 0.25, Announcement.ADSB: 1.0, Announcement.AIS: 1.0}

HEARTBEAT_S = 1.0

ADSB = 156
"""Component id of a receiver of its own."""

GENERIC, GROUND_ROVER, ACTIVE = 0, 10, 4

SURFACE_SERVICE = 18

ADSB_FLAGS = (
    mavlink.ADSB_FLAGS_VALID_COORDS
    | mavlink.ADSB_FLAGS_VALID_ALTITUDE
    | mavlink.ADSB_FLAGS_VALID_HEADING
    | mavlink.ADSB_FLAGS_VALID_VELOCITY
)

AIS_FLAGS = mavlink.AIS_FLAGS_VALID_COG | mavlink.AIS_FLAGS_VALID_VELOCITY | mavlink.AIS_FLAGS_VALID_DIMENSIONS


class Outlet(Protocol):
    """Where announcements go out: a channel of the autopilot, or a link to one elsewhere."""

    outbox: bytearray

    def send(self, message: Any) -> None:
        """Queue what the autopilot's receivers heard, as its own message."""
        ...


class TrafficPort:
    """A link to an autopilot elsewhere: what its receivers would have heard comes from ``ADSB`` of its system."""

    def __init__(self) -> None:
        self.outbox = bytearray()
        self._codec = new_codec(ADSB)

    def belong_to(self, system: int) -> None:
        """The autopilot's system id."""
        self._codec.srcSystem = system

    def send(self, message: Any) -> None:
        """See Outlet."""
        self.outbox += packed(message, self._codec)

    def take(self) -> bytes:
        """What was sent since the last call."""
        data = bytes(self.outbox)
        self.outbox.clear()
        return data


class Traffic:
    """Sends the messages of every mover that announces itself; vehicles have sequence numbers of their own."""

    def __init__(self, world: World, origin: tuple[int, int], origin_m: tuple[float, float]) -> None:
        """``origin``: a place on earth, 1e-7 degree; ``origin_m``: the same place in the world frame."""
        self._world = world
        self._origin = origin
        self._origin_m = origin_m
        self._talkers = [number for number, mover in enumerate(world.movers) if mover.announce]
        vehicles = [number for number in self._talkers if world.movers[number].announce is Announcement.VEHICLE]
        self._codecs = {n: new_codec(AUTOPILOT, min(FIRST_SYSTEM + i, 250)) for i, n in enumerate(vehicles)}
        self._due_s = {number: 0.05 * i for i, number in enumerate(self._talkers)}
        self._heartbeat_s = dict.fromkeys(vehicles, 0.0)

    @property
    def talks(self) -> bool:
        """Whether anything announces itself."""
        return bool(self._talkers)

    def next_due_s(self) -> float:
        """Time of the next packet; inf without announced movers."""
        return min(self._due_s.values(), default=math.inf)

    def send_due(self, time_s: float, channels: Iterable[Outlet]) -> None:
        """Send what is due at this moment."""
        channels = tuple(channels)
        for number in self._talkers:
            if time_s < self._due_s[number] - 1e-9:
                continue
            announcement = self._world.movers[number].announce
            assert announcement is not None
            self._due_s[number] += INTERVALS_S[announcement]
            for message in self._messages(number, time_s):
                data = packed(message, self._codecs[number]) if number in self._codecs else b""
                for channel in channels:
                    if data:
                        channel.outbox += data
                    else:
                        channel.send(message)

    def _messages(self, number: int, time_s: float) -> list[Any]:
        mover = self._world.movers[number]
        north_m, east_m, north_m_s, east_m_s = self._world.mover_at(number, time_s)
        place = geodesy.moved(self._origin, north_m - self._origin_m[0], east_m - self._origin_m[1])
        course_cdeg = round(math.degrees(math.atan2(east_m_s, north_m_s)) * 100.0) % 36000
        speed_cm_s = round(100.0 * math.hypot(north_m_s, east_m_s))
        if mover.announce is Announcement.ADSB:
            return [_adsb(number, place, course_cdeg, speed_cm_s, mover.name)]
        if mover.announce is Announcement.AIS:
            return [_ais(number, place, course_cdeg, speed_cm_s, mover.radius_m, mover.name)]
        messages: list[Any] = []
        if time_s >= self._heartbeat_s[number] - 1e-9:
            self._heartbeat_s[number] = time_s + HEARTBEAT_S
            messages.append(mavlink.MAVLink_heartbeat_message(GROUND_ROVER, GENERIC, 0, 0, ACTIVE, 3))
        velocity = (round(100.0 * north_m_s), round(100.0 * east_m_s), 0)
        altitude_mm = round(ALTITUDE_M * 1000)
        messages.append(
            mavlink.MAVLink_global_position_int_message(
                round(time_s * 1000), *place, altitude_mm, 0, *velocity, course_cdeg
            )
        )
        return messages


def _adsb(number: int, place: tuple[int, int], course_cdeg: int, speed_cm_s: int, name: str) -> Any:
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00000 + number, *place, 0, round(ALTITUDE_M * 1000), course_cdeg, speed_cm_s, 0,
        name.encode("ascii", "replace")[:8], SURFACE_SERVICE, 0, ADSB_FLAGS, 0,
    )  # fmt: skip


def _ais(number: int, place: tuple[int, int], course_cdeg: int, speed_cm_s: int, radius_m: float, name: str) -> Any:
    side_m = math.ceil(radius_m)
    callsign, text = f"R{number}".encode(), name.encode("ascii", "replace")[:20]
    return mavlink.MAVLink_ais_vessel_message(
        999000000 + number, *place, course_cdeg, course_cdeg, speed_cm_s, 0, 0, 0,
        side_m, side_m, side_m, side_m, callsign, text, 0, AIS_FLAGS,
    )  # fmt: skip
