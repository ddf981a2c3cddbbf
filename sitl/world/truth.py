"""The rover's start, its true state, and its collisions, in the world frame.

Nouns: Collision, Truth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from sitl.world import geodesy
from sitl.world.world import World

DOOR_NEAR_M = 0.1
"""A door so near to the rover's outline is what it touched."""


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


STOOD_M_S = 0.1
"""A rover that is slower than this stands."""


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

    ``mover``: name of the moving obstacle, if it was one; ``speed_m_s``: the rover's own speed then, without a sign;
    ``door``: name of the door, if it was one.
    """

    time_s: float
    north_m: float
    east_m: float
    mover: str | None
    speed_m_s: float
    door: str | None = None

    @property
    def was_run_into(self) -> bool:
        """Whether the rover stood, and something that moves came along."""
        return self.mover is not None and self.speed_m_s < STOOD_M_S

    @property
    def what(self) -> str:
        """What was touched."""
        return self.mover or self.door or "an obstacle"

    def told(self, start: SimStart) -> str:
        """The rover's own speed, what was touched, when, and where from the rover's start, like LOCAL_POSITION_NED."""
        # Zero is added so that there is no minus before a rounded zero.
        north_m, east_m = (round(v, 1) + 0.0 for v in self.from_start(start))
        where = f"north {north_m:.1f} m, east {east_m:.1f} m of its start"
        return f"the rover, driving {self.speed_m_s:.1f} m/s, touched {self.what} at {self.time_s:.1f} s, {where}"

    def from_start(self, start: SimStart) -> tuple[float, float]:
        """Where the rover was, metres north and east of its start."""
        return self.north_m - start.north_m, self.east_m - start.east_m

    def as_json(self, start: SimStart) -> dict[str, float | str]:
        """The same, with metres from the rover's start."""
        north_m, east_m = self.from_start(start)
        return {
            "time_s": round(self.time_s, 2),
            "north_m": round(north_m, 3) + 0.0,
            "east_m": round(east_m, 3) + 0.0,
            "speed_m_s": round(self.speed_m_s, 3),
            "with": self.what,
        }


def collision_of(rover: Any, world: World, time_s: float) -> Collision:
    """The contact that the plant's record has just noted."""
    struck, here = int(rover["struck"]), (float(rover["north_m"]), float(rover["east_m"]))
    speed_m_s = abs(float(rover["struck_m_s"]))
    if struck:
        return Collision(time_s, *here, world.movers[struck - 1].name, speed_m_s)
    reach_m = math.hypot(max(rover["front_m"], rover["rear_m"], rover["radius_m"]), rover["half_width_m"])
    return Collision(time_s, *here, None, speed_m_s, world.nearest_door(*here, reach_m + DOOR_NEAR_M, time_s))
