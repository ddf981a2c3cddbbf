"""What the autopilot has stored of mission, fence and rally points, as it tells it piece by piece (MAVLink's mission protocol)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class PlanKind(IntEnum):
    """Which of the stored lists (MAV_MISSION_TYPE)."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


@dataclass(frozen=True, slots=True)
class PlanCountSeen:
    """MISSION_COUNT to us: how many items a list has."""

    time_s: float
    kind: int
    count: int


@dataclass(frozen=True, slots=True)
class PlanItemSeen:
    """MISSION_ITEM_INT to us: one item; ``lat_deg`` and ``lon_deg`` mean nothing in commands without a place."""

    time_s: float
    kind: int
    index: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    autocontinue: bool


@dataclass(frozen=True, slots=True)
class PlanChangedSeen:
    """Somebody else's upload of a list was accepted (a MISSION_ACK that came by)."""

    time_s: float
    kind: int
