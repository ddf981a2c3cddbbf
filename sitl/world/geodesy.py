"""Geodesy of the simulator: latitude and longitude to metres and back.

It shares no code with the companion, so that the same error cannot cancel out in both.

Latitude and longitude are integers of 1e-7 degree, as the firmware stores them; offsets are metres north and east.

Nouns: geodesy.
"""

from __future__ import annotations

import math

METRES_PER_UNIT = 0.011131884502145034
"""Metres along a meridian for 1e-7 degree (the firmware's scaling constant)."""

HALF_TURN = 1_800_000_000
"""180 degrees of longitude."""

ALTITUDE_M = 120.0
"""Height of the ground above sea level, everywhere."""


def to_units(degrees: float) -> int:
    """Degrees as an integer of 1e-7 degree."""
    return round(degrees * 1e7)


def longitude_scale(lat_a: int, lat_b: int) -> float:
    """Length of a unit of longitude relative to one of latitude, half-way between two latitudes."""
    return max(math.cos(math.radians((lat_a + lat_b) * 0.5e-7)), 0.01)


def offset_m(origin: tuple[int, int], place: tuple[int, int]) -> tuple[float, float]:
    """Metres north and east from ``origin`` to ``place``, both (latitude, longitude) in 1e-7 degree."""
    lon_units = place[1] - origin[1]
    if lon_units > HALF_TURN:
        lon_units -= 2 * HALF_TURN
    elif lon_units < -HALF_TURN:
        lon_units += 2 * HALF_TURN
    north_m = (place[0] - origin[0]) * METRES_PER_UNIT
    return north_m, lon_units * METRES_PER_UNIT * longitude_scale(origin[0], place[0])


def moved(origin: tuple[int, int], north_m: float, east_m: float) -> tuple[int, int]:
    """The (latitude, longitude) at this many metres north and east of ``origin``.

    Fractions of a unit are truncated towards the origin, as in the firmware.
    """
    lat = origin[0] + int(north_m / METRES_PER_UNIT)
    lon = origin[1] + int(east_m / METRES_PER_UNIT / longitude_scale(origin[0], lat))
    return lat, (lon + HALF_TURN) % (2 * HALF_TURN) - HALF_TURN
