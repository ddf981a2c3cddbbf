"""What the autopilot tells of the lists it has stored (MAVLink's mission protocol), of its fence, and of its batteries."""

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


@dataclass(frozen=True, slots=True)
class FenceStatusSeen:
    """FENCE_STATUS, which comes only while a fence is switched on: whether the rover is beyond it."""

    time_s: float
    breached: bool


@dataclass(frozen=True, slots=True)
class BatterySeen:
    """One battery by BATTERY_STATUS; from SYS_STATUS ``number`` is -1. What is not known is None.

    ``charge_state``: MAV_BATTERY_CHARGE_STATE, how far the autopilot's own failsafe has gone (0 undefined, 1 ok, 2 low, 3 critical).
    """

    time_s: float
    number: int
    volts: float | None
    percent: int | None
    charge_state: int = 0
