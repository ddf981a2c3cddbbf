"""The scanner: a component of its own (196). The autopilot's router forwards its OBSTACLE_DISTANCE wherever somebody was heard."""

from __future__ import annotations

import math
from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot_link import new_codec, packed
from sitl.autopilot_proximity import take_in
from sitl.autopilot_vehicle import Vehicle
from sitl.sensors import Lidar, RangeSensing

OBSTACLE_AVOIDANCE = 196
HEARTBEAT_US = 1_000_000
OWN_CHANNEL = -1
"""The scanner's place in the router: packets for it are not for the autopilot, and it answers none."""
SIGNING_LINK = 255
"""With a signing key on the vehicle the scanner signs as well, as a link of its own."""


class LidarComponent:
    """Packs scans and heartbeats at the scanner's rate."""

    def __init__(self, lidar: Lidar, sensing: RangeSensing, vehicle: Vehicle) -> None:
        """``sensing`` measures, ``vehicle`` hears the scans as everybody on its network does."""
        self._lidar = lidar
        self._vehicle = vehicle
        vehicle.router.learn(vehicle.system, OBSTACLE_AVOIDANCE, OWN_CHANNEL)
        self._sensing = sensing
        self._codec = new_codec(OBSTACLE_AVOIDANCE, vehicle.system)
        self._interval_us = 1e6 / lidar.rate_hz
        self._scan_us = self._interval_us
        self._heartbeat_us = 0.0
        self._late_us = lidar.flaws.latency_s * 1e6
        self._waiting: deque[tuple[float, list[int]]] = deque()

    def next_due_us(self) -> float:
        """Time of the next packet."""
        return min(self._scan_us, self._heartbeat_us, self._waiting[0][0] if self._waiting else math.inf)

    def packets(self, time_us: int, north_m: float, east_m: float, heading_rad: float) -> bytes:
        """What the scanner sends at this moment; empty when nothing is due."""
        data = b""
        self._vehicle.signing.follow(self._codec, SIGNING_LINK)
        if time_us >= self._heartbeat_us:
            self._heartbeat_us += HEARTBEAT_US
            data += packed(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), self._codec)
        if time_us >= self._scan_us:
            self._scan_us = max(self._scan_us + self._interval_us, float(time_us - HEARTBEAT_US))
            cells = self._sensing.scan_cm(north_m, east_m, heading_rad)
            if self._sensing.lidar_fault != "silent":
                self._waiting.append((time_us + self._late_us, cells))
        while self._waiting and self._waiting[0][0] <= time_us + 0.5:
            data += self._packed(time_us, self._waiting.popleft()[1])
        return data

    def _packed(self, time_us: int, cells: list[int]) -> bytes:
        """A late scan bears the time at which it is sent: few drivers know how long theirs took."""
        lidar = self._lidar
        message = mavlink.MAVLink_obstacle_distance_message(
            time_us, 0, cells, round(lidar.increment_deg), round(lidar.min_m * 100), round(lidar.max_m * 100),
            lidar.increment_deg, lidar.offset_deg, 12,
        )  # fmt: skip
        take_in(self._vehicle, message)
        return packed(message, self._codec)
