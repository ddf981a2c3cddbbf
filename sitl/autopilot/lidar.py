"""The lidar: a MAVLink component (196) on the vehicle's network, or on a link to a real autopilot.

Nouns: LidarComponent.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.channel import new_codec, packed
from sitl.autopilot.framing import Framer
from sitl.autopilot.proximity import BODY_FRAME, take_in
from sitl.autopilot.routing import AUTOPILOT
from sitl.autopilot.vehicle import Vehicle
from sitl.sensors.range_sensors import UNKNOWN, Defect, Lidar, RangeSensing

OBSTACLE_AVOIDANCE = 196

HEARTBEAT_US = 1_000_000

NO_NUMBER = 65535
"""Points are not tracked."""


class Scanner:
    """Scans at the lidar's rate, and heartbeats, as messages that are not packed yet."""

    def __init__(self, lidar: Lidar, sensing: RangeSensing) -> None:
        """``sensing`` takes the measurements."""
        self._lidar = lidar
        self._sensing = sensing
        self._interval_us = 1e6 / lidar.rate_hz
        self._scan_us = self._interval_us
        self._heartbeat_us = 0.0
        self._late_us = lidar.flaws.latency_s * 1e6
        self._waiting: deque[tuple[float, list[int]]] = deque()

    def next_due_us(self) -> float:
        """Time of the next message."""
        return min(self._scan_us, self._heartbeat_us, self._waiting[0][0] if self._waiting else math.inf)

    def due(self, time_us: int, north_m: float, east_m: float, heading_rad: float) -> list[Any]:
        """The messages due at this moment."""
        messages: list[Any] = []
        if time_us >= self._heartbeat_us:
            self._heartbeat_us += HEARTBEAT_US
            messages.append(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        if time_us >= self._scan_us:
            self._scan_us = max(self._scan_us + self._interval_us, float(time_us - HEARTBEAT_US))
            cells = self._sensing.scan_cm(north_m, east_m, heading_rad)
            if self._sensing.lidar_fault is not Defect.SILENT:
                self._waiting.append((time_us + self._late_us, cells))
        while self._waiting and self._waiting[0][0] <= time_us + 0.5:
            cells = self._waiting.popleft()[1]
            messages += self._points(time_us, cells) if self._lidar.as_points else [self._message(time_us, cells)]
        return messages

    def _points(self, time_us: int, cells: list[int]) -> list[Any]:
        """A scan as points at the sensor's own height; where nothing was seen, at its maximum."""
        lidar, points = self._lidar, []
        for number, cell in enumerate(cells):
            if cell == UNKNOWN:
                continue
            range_m = min(cell / 100.0, lidar.max_m)
            bearing_rad = math.radians(lidar.offset_deg + number * lidar.increment_deg)
            place = (range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad), 0.0)
            points.append(
                mavlink.MAVLink_obstacle_distance_3d_message(
                    time_us // 1000, 0, BODY_FRAME, NO_NUMBER, *place, lidar.min_m, lidar.max_m
                )
            )
        return points

    def _message(self, time_us: int, cells: list[int]) -> Any:
        """A delayed scan carries the time at which it is sent: few drivers know how old a scan is."""
        lidar = self._lidar
        return mavlink.MAVLink_obstacle_distance_message(
            time_us, 0, cells, round(lidar.increment_deg), round(lidar.min_m * 100), round(lidar.max_m * 100),
            lidar.increment_deg, lidar.offset_deg, 12,
        )  # fmt: skip


class ScannerPort:
    """The lidar's own link to an autopilot elsewhere; it takes over that autopilot's system id and does not sign."""

    def __init__(self) -> None:
        """System 1 until an autopilot is heard."""
        self._codec = new_codec(OBSTACLE_AVOIDANCE)
        self._framer = Framer()
        self._settled = False
        self.system: int | None = None
        """The autopilot's system id; None until it is heard."""

    def begin(self) -> None:
        """The autopilot has restarted and may have another id."""
        self._settled = False

    def hear(self, data: bytes) -> None:
        """Take in bytes. The first heartbeat of an ArduPilot counts: later ones may be other vehicles'."""
        for packet in self._framer.feed(data):
            try:
                message = self._codec.decode(bytearray(packet))
            except (mavlink.MAVError, struct.error):  # damaged or unknown
                continue
            of_autopilot = message.get_type() == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT
            if of_autopilot and message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and not self._settled:
                self._codec.srcSystem = self.system = message.get_srcSystem()
                self._settled = True

    def packed(self, messages: list[Any]) -> bytes:
        """The messages as bytes."""
        return b"".join(packed(message, self._codec) for message in messages)


OWN_CHANNEL = -1
"""The lidar's channel in the router: packets addressed to it are not for the autopilot, and it answers none."""

SIGNING_LINK = 255
"""Link id of the lidar's signatures: with a signing key on the vehicle it signs as well."""


class LidarComponent:
    """The lidar on the simulated vehicle: packs its messages and passes its scans to the autopilot.

    The autopilot's router forwards them to every link on which a client was heard.
    """

    def __init__(self, lidar: Lidar, sensing: RangeSensing, vehicle: Vehicle) -> None:
        """``sensing`` takes the measurements; ``vehicle`` receives the scans as every component on its network does."""
        self._scanner = Scanner(lidar, sensing)
        self._vehicle = vehicle
        vehicle.router.learn(vehicle.system, OBSTACLE_AVOIDANCE, OWN_CHANNEL)
        self._codec = new_codec(OBSTACLE_AVOIDANCE, vehicle.system)

    def next_due_us(self) -> float:
        """Time of the next packet."""
        return self._scanner.next_due_us()

    def packets(self, time_us: int, north_m: float, east_m: float, heading_rad: float) -> bytes:
        """The bytes due at this moment."""
        data = b""
        self._vehicle.signing.follow(self._codec, SIGNING_LINK)
        for message in self._scanner.due(time_us, north_m, east_m, heading_rad):
            if message.get_type() == "OBSTACLE_DISTANCE":
                take_in(self._vehicle, message)
            data += packed(message, self._codec)
        return data
