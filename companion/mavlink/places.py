"""Places as MAVLink writes them."""

from __future__ import annotations

from companion.core.frames import GeoPoint


def point_of(lat_e7: int, lon_e7: int) -> GeoPoint | None:
    """Degrees from 1e-7 degrees; None for 0/0, which is sent when there is no position, and for what is not on the earth."""
    if (lat_e7 == 0 and lon_e7 == 0) or abs(lat_e7) > 90e7 or abs(lon_e7) > 180e7:
        return None
    return GeoPoint(lat_e7 / 1e7, lon_e7 / 1e7)
