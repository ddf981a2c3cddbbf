"""A MAVLink mission item, as files and the autopilot hold it, and the error for a wrong one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.core.frames import GeoPoint
from companion.mission import mav_commands as mav
from companion.mission.tables import swapped_hint

MAX_ITEMS = 100_000
XML = "is XML (KML, GPX?); load it into a ground station, and save a mission from there"


class ItemError(Exception):
    """A wrong item: place and reason. The reader adds the file and makes it a MissionError."""


@dataclass(frozen=True, slots=True)
class Item:
    """One mission item. Jumps refer to ``index``; ``params`` are p1 to p4, nan where the file has none.

    ``lat_deg``, ``lon_deg`` and ``altitude_m`` are p5 to p7 of commands without a place.
    """

    index: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    autocontinue: bool = True
    altitude_m: float = 0.0
    kind: str = ""
    """What it is, if it is no MAVLink command."""

    @property
    def what(self) -> str:
        """Its command with its number, for people."""
        return self.kind or mav.command_name(self.command)

    @property
    def label(self) -> str:
        """Its name in messages."""
        return f"item {self.index}: {self.what}"

    def param(self, number: int) -> float:
        """p1 to p4; a missing one is 0, the default in every command that is understood here."""
        value = self.params[number - 1]
        return 0.0 if math.isnan(value) else value

    @property
    def is_here(self) -> bool:
        """Whether it has no place of its own: to ArduPilot, latitude and longitude 0 are the present place."""
        return self.lat_deg == 0.0 and self.lon_deg == 0.0


def geo_point(lat_deg: float, lon_deg: float, what: str) -> GeoPoint:
    """A latitude and longitude that exist. Raises ItemError."""
    if not (math.isfinite(lat_deg) and math.isfinite(lon_deg)):
        raise ItemError(f"{what}: latitude and longitude are missing")
    if not (-90.0 <= lat_deg <= 90.0 and -180.0 <= lon_deg <= 180.0):
        hint = swapped_hint(lat_deg, lon_deg)
        raise ItemError(f"{what}: {lat_deg}, {lon_deg} is not a latitude and longitude{hint}")
    return GeoPoint(lat_deg, lon_deg)
