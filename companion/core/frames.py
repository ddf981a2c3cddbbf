"""Places and poses, each with its frame in the type, and the one conversion between them.

Frames: *geo* is WGS-84 latitude and longitude in degrees; *NED* is the autopilot's local frame, metres north
and east of the EKF origin. Headings are clockwise from north.

Nouns: NedPoint, GeoPoint, Pose, local frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

METRES_PER_DEGREE = 0.011131884502145034 * 1e7
"""ArduPilot's constant: metres along a meridian for one degree (LOCATION_SCALING_FACTOR, per 1e-7 degree)."""


@dataclass(frozen=True, slots=True)
class NedPoint:
    """A place in the autopilot's local frame, metres from the EKF origin."""

    north_m: float
    east_m: float

    def distance_m(self, other: NedPoint) -> float:
        """Straight distance to another place, in metres."""
        return math.hypot(other.north_m - self.north_m, other.east_m - self.east_m)

    def bearing_rad(self, other: NedPoint) -> float:
        """Bearing from here to another place, clockwise from north, in (-pi, pi]."""
        return math.atan2(other.east_m - self.east_m, other.north_m - self.north_m)

    def moved(self, bearing_rad: float, distance_m: float) -> NedPoint:
        """The place at this bearing and distance from here."""
        return NedPoint(
            self.north_m + distance_m * math.cos(bearing_rad), self.east_m + distance_m * math.sin(bearing_rad)
        )


@dataclass(frozen=True, slots=True)
class GeoPoint:
    """A place on the earth, WGS-84 degrees."""

    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the rover is: local frame, heading clockwise from north, and the companion's clock."""

    north_m: float
    east_m: float
    heading_rad: float
    time_s: float

    @property
    def point(self) -> NedPoint:
        """The place without the heading."""
        return NedPoint(self.north_m, self.east_m)


def wrap_pi_rad(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """Converts between geo and NED as the autopilot itself does.

    The autopilot's local frame is not a tangent plane: ArduPilot scales both axes with one constant, and longitude
    with the cosine of the mean latitude. A textbook geodesic would differ from what the rover reports by
    0.3 % (3 m on a kilometre), so its own rule is used; recordings of ArduRover are the test.
    """

    origin: GeoPoint

    def to_ned(self, point: GeoPoint) -> NedPoint:
        """Metres north and east of the origin."""
        mean_lat_rad = math.radians((point.lat_deg + self.origin.lat_deg) / 2.0)
        scale = max(math.cos(mean_lat_rad), 0.01)
        lon_deg = (point.lon_deg - self.origin.lon_deg + 180.0) % 360.0 - 180.0
        return NedPoint((point.lat_deg - self.origin.lat_deg) * METRES_PER_DEGREE, lon_deg * METRES_PER_DEGREE * scale)

    def to_geo(self, point: NedPoint) -> GeoPoint:
        """Latitude and longitude of a place in the local frame."""
        lat_deg = self.origin.lat_deg + point.north_m / METRES_PER_DEGREE
        scale = max(math.cos(math.radians((lat_deg + self.origin.lat_deg) / 2.0)), 0.01)
        lon_deg = self.origin.lon_deg + point.east_m / (METRES_PER_DEGREE * scale)
        return GeoPoint(lat_deg, (lon_deg + 180.0) % 360.0 - 180.0)
