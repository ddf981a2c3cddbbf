"""Positions in MAVLink messages: latitude and longitude, and other vehicles by GLOBAL_POSITION_INT, ADS-B and AIS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.vehicle.events import OtherSeen

RECEIVED = (mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, mavlink.MAVLINK_MSG_ID_AIS_VESSEL)
"""Receivers on the vehicle itself send these about other vehicles."""
NO_COURSE = 36000
LARGEST_M = 500.0
"""Larger values are cut: no ship is larger."""


def point_of(lat_e7: int, lon_e7: int) -> GeoPoint | None:
    """Degrees from 1e-7 degrees. None for 0/0, which means no position, and for values out of range."""
    if (lat_e7 == 0 and lon_e7 == 0) or abs(lat_e7) > 90e7 or abs(lon_e7) > 180e7:
        return None
    return GeoPoint(lat_e7 / 1e7, lon_e7 / 1e7)


def global_position(message: Any, time_s: float) -> OtherSeen | None:
    """GLOBAL_POSITION_INT of another system."""
    point = point_of(message.lat, message.lon)
    if point is None:
        return None
    name = f"system {message.get_srcSystem()}"
    return OtherSeen(
        time_s, name, time_s, point, message.vx / 100.0, message.vy / 100.0, altitude_m=message.alt / 1000.0
    )


def adsb_vehicle(message: Any, time_s: float) -> OtherSeen | None:
    """ADSB_VEHICLE; fields without their valid flag are unknown. Without a valid speed it stands still."""
    point = point_of(message.lat, message.lon) if message.flags & mavlink.ADSB_FLAGS_VALID_COORDS else None
    if point is None:
        return None
    moves = mavlink.ADSB_FLAGS_VALID_HEADING | mavlink.ADSB_FLAGS_VALID_VELOCITY
    speed_m_s = message.hor_velocity / 100.0 if message.flags & moves == moves else 0.0
    altitude_m = message.altitude / 1000.0 if message.flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE else None
    name = f"ADS-B {message.ICAO_address:06X}"
    velocity = _velocity(speed_m_s, message.heading)
    return OtherSeen(time_s, name, time_s - message.tslc, point, *velocity, altitude_m=altitude_m)


def ais_vessel(message: Any, time_s: float) -> OtherSeen | None:
    """AIS_VESSEL.

    Its position is its antenna's, often far aft; its radius reaches from there to the farthest of bow, stern and sides.
    """
    point = point_of(message.lat, message.lon)
    if point is None:
        return None
    moves = mavlink.AIS_FLAGS_VALID_COG | mavlink.AIS_FLAGS_VALID_VELOCITY
    speed_m_s = message.velocity / 100.0 if message.flags & moves == moves and message.COG < NO_COURSE else 0.0
    radius_m = None
    if message.flags & mavlink.AIS_FLAGS_VALID_DIMENSIONS:
        sides_m = (message.dimension_bow, message.dimension_stern, message.dimension_port, message.dimension_starboard)
        radius_m = min(float(max(sides_m)), LARGEST_M) or None
    velocity = _velocity(speed_m_s, message.COG)
    return OtherSeen(time_s, f"AIS {message.MMSI}", time_s - message.tslc, point, *velocity, radius_m=radius_m)


def _velocity(speed_m_s: float, course_cdeg: int) -> tuple[float, float]:
    course_rad = math.radians(course_cdeg / 100.0)
    return speed_m_s * math.cos(course_rad), speed_m_s * math.sin(course_rad)


READERS: Mapping[int, Callable[[Any, float], OtherSeen | None]] = MappingProxyType(
    {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: adsb_vehicle,
        mavlink.MAVLINK_MSG_ID_AIS_VESSEL: ais_vessel,
    }
)
