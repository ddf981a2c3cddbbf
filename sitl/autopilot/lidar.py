"""The scanner on the simulated vehicle's network. The autopilot's router forwards its scans wherever somebody was heard."""

from __future__ import annotations

from sitl.autopilot.link import new_codec, packed
from sitl.autopilot.proximity import take_in
from sitl.autopilot.scanner import OBSTACLE_AVOIDANCE, Scanner
from sitl.autopilot.vehicle import Vehicle
from sitl.sensors.range_sensors import Lidar, RangeSensing

OWN_CHANNEL = -1
"""The scanner's place in the router: packets for it are not for the autopilot, and it answers none."""
SIGNING_LINK = 255
"""With a signing key on the vehicle the scanner signs as well, as a link of its own."""


class LidarComponent:
    """Packs what the scanner says, and lets the vehicle hear it."""

    def __init__(self, lidar: Lidar, sensing: RangeSensing, vehicle: Vehicle) -> None:
        """``sensing`` measures, ``vehicle`` hears the scans as everybody on its network does."""
        self._scanner = Scanner(lidar, sensing)
        self._vehicle = vehicle
        vehicle.router.learn(vehicle.system, OBSTACLE_AVOIDANCE, OWN_CHANNEL)
        self._codec = new_codec(OBSTACLE_AVOIDANCE, vehicle.system)

    def next_due_us(self) -> float:
        """Time of the next packet."""
        return self._scanner.next_due_us()

    def packets(self, time_us: int, north_m: float, east_m: float, heading_rad: float) -> bytes:
        """What the scanner sends at this moment; empty when nothing is due."""
        data = b""
        self._vehicle.signing.follow(self._codec, SIGNING_LINK)
        for message in self._scanner.due(time_us, north_m, east_m, heading_rad):
            if message.get_type() == "OBSTACLE_DISTANCE":
                take_in(self._vehicle, message)
            data += packed(message, self._codec)
        return data
