"""What can be learned of an autopilot without moving anything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from companion.vehicle.state import VehicleState


@dataclass(frozen=True, slots=True)
class RangeSource:
    """A range sensor, as its messages describe it.

    ``sector``: one of the autopilot's own 45 degree sectors. ``orientation`` as in DISTANCE_SENSOR, None for one that looks about
    (OBSTACLE_DISTANCE). ``blind``: no reading so far meant anything.
    """

    message: str
    component: int
    sensor: int
    orientation: int | None
    min_m: float
    max_m: float
    rate_hz: float
    sector: bool = False
    blind: bool = False


@dataclass(frozen=True, slots=True)
class SlowMessage:
    """A message that comes at less than three fifths of the rate asked for."""

    name: str
    wanted_hz: float
    measured_hz: float


@dataclass(frozen=True, slots=True)
class Autopilot:
    """Somebody who spoke as an autopilot (component 1): MAV_TYPE and MAV_AUTOPILOT."""

    system: int
    kind: int
    make: int


@dataclass(frozen=True, slots=True)
class Examined:
    """After having listened and asked. ``parameters`` holds those that were told; ``asked`` those that were asked for."""

    place: str
    system: int = 1
    component: int = 191
    vehicle: VehicleState = field(default_factory=VehicleState)
    rover_heard: bool = False
    autopilots: tuple[Autopilot, ...] = ()
    systems: frozenset[int] = frozenset()
    """Everybody who was heard."""
    companion_heard: bool = False
    version: tuple[int, int, int] | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    asked: tuple[str, ...] = ()
    sources: tuple[RangeSource, ...] = ()
    slow: tuple[SlowMessage, ...] = ()
    texts: tuple[str, ...] = ()
    fence_breached: bool = False
    signing: str = ""
    """What is wrong with signatures, and"""
    signing_remedy: str = ""
    """what to do about it."""
    unbelieved: int | None = None
    """The system id of a rover that is heard, but not believed: its packets are not signed with our key."""
    lost: int = 0
    packets: int = 0
