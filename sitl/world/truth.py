"""The rover's start, its true state, and its collisions, in the world frame.

Nouns: Collision, Truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from sitl.world import geodesy


class GeoPlace(Protocol):
    """Anything with latitude and longitude in degrees."""

    @property
    def lat_deg(self) -> float:
        """Latitude, WGS-84."""
        ...

    @property
    def lon_deg(self) -> float:
        """Longitude, WGS-84."""
        ...


@dataclass(frozen=True, slots=True)
class SimStart:
    """Where the rover is switched on: in the world frame, and as latitude and longitude.

    The EKF origin and home are set here, so LOCAL_POSITION_NED begins at 0, 0.
    """

    north_m: float
    east_m: float
    heading_rad: float
    home: GeoPlace

    def place_of(self, place: GeoPlace) -> tuple[float, float]:
        """World frame coordinates (north, east in metres) of a latitude and longitude."""
        home = (geodesy.to_units(self.home.lat_deg), geodesy.to_units(self.home.lon_deg))
        there = (geodesy.to_units(place.lat_deg), geodesy.to_units(place.lon_deg))
        north_m, east_m = geodesy.offset_m(home, there)
        return self.north_m + north_m, self.east_m + east_m


@dataclass(frozen=True, slots=True)
class Truth:
    """The rover's true state, world frame."""

    time_s: float
    north_m: float
    east_m: float
    heading_rad: float
    speed_m_s: float
    yaw_rate_rad_s: float
    slide_m_s: float = 0.0
    """Sideways speed, to the right; not 0 only on slippery ground."""


@dataclass(frozen=True, slots=True)
class Collision:
    """The rover touched an obstacle: when, and where its centre was (world frame).

    ``mover``: name of the moving obstacle, if it was one; ``speed_m_s``: the rover's own speed then.
    """

    time_s: float
    north_m: float
    east_m: float
    mover: str | None = None
    speed_m_s: float = math.nan


class Named(Protocol):
    """Anything with a name for people."""

    @property
    def name(self) -> str:
        """The name."""
        ...


def collision_of(rover: Any, movers: Sequence[Named], time_s: float) -> Collision:
    """The contact that the plant's record has just noted; ``movers``: the world's, in their order."""
    struck, here = int(rover["struck"]), (float(rover["north_m"]), float(rover["east_m"]))
    if struck == 0:
        return Collision(time_s, *here)
    return Collision(time_s, *here, movers[struck - 1].name, float(rover["struck_m_s"]))
