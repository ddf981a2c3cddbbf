"""Survey of an autopilot: what it says about itself, its sensors and its link, without moving anything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from companion.vehicle.state import VehicleState


@dataclass(frozen=True, slots=True)
class RangeSource:
    """A range sensor, as its messages describe it.

    ``sector``: one of the autopilot's own 45 degree sectors. ``orientation`` as in DISTANCE_SENSOR; None for a scanning
    sensor (OBSTACLE_DISTANCE, or points of OBSTACLE_DISTANCE_3D). ``blind``: no valid reading so far.
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
    frame: int | None = None
    """MAV_FRAME of obstacle points; None for other messages."""


@dataclass(frozen=True, slots=True)
class SlowMessage:
    """A message that arrives at less than three fifths of the requested rate."""

    name: str
    wanted_hz: float
    measured_hz: float


@dataclass(frozen=True, slots=True)
class Autopilot:
    """A sender of heartbeats as an autopilot (component 1): ``kind`` is its MAV_TYPE, ``make`` its MAV_AUTOPILOT."""

    system: int
    kind: int
    make: int


@dataclass(frozen=True, slots=True)
class Survey:
    """What listening and asking has shown.

    ``asked``: the parameters asked for; ``parameters``: those that were answered.
    """

    place: str
    system: int = 1
    component: int = 191
    vehicle: VehicleState = field(default_factory=VehicleState)
    rover_heard: bool = False
    autopilots: tuple[Autopilot, ...] = ()
    systems: frozenset[int] = frozenset()
    """The system ids of all senders."""
    companion_heard: bool = False
    version: tuple[int, int, int] | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    asked: tuple[str, ...] = ()
    sources: tuple[RangeSource, ...] = ()
    slow: tuple[SlowMessage, ...] = ()
    texts: tuple[str, ...] = ()
    fence_breached: bool = False
    signing: str = ""
    """What is wrong with signatures; empty if nothing is."""
    signing_remedy: str = ""
    """What to do about it."""
    unbelieved: int | None = None
    """The system id of a rover whose packets are refused, because they are not signed with the companion's key."""
    strange: bytes = b""
    """The newest bytes of a link on which no packet has come; empty if one has."""
    wired: bool = False
    """Whether there are lidars on serial ports of the companion."""
    lost: int = 0
    packets: int = 0
    bad_bytes: int = 0
    """Bytes that belong to no packet,"""
    read_bytes: int = 0
    """of so many that were read."""
    rivals: tuple[str, ...] = ()
    """Other programs that have the serial device open, in words."""
