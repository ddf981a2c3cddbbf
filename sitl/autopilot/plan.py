"""What the autopilot remembers of missions, fences, rally points and ways back; plain values, no behaviour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

from sitl.autopilot.items import Item
from sitl.autopilot.mission import Mission

MISSION, FENCE, RALLY = 0, 1, 2
"""MAV_MISSION_TYPE."""


@dataclass
class Storage:
    """What survives a reboot."""

    mission: list[Item] = field(default_factory=list)
    fence: list[Item] = field(default_factory=list)
    rally: list[Item] = field(default_factory=list)


@dataclass
class Upload:
    """A transfer to the vehicle that is under way; times are microseconds since boot."""

    channel: int
    system: int
    component: int
    next: int
    last: int
    heard_us: int
    asked_us: int
    fence: list[Item | None] = field(default_factory=list)
    """The fence is put together here and taken over as a whole."""


class Submode(Enum):
    """What AUTO is doing."""

    STOP = "stop"
    WAYPOINT = "waypoint"
    HEADING = "heading"
    RETURN = "return"
    GUIDED = "guided"
    CIRCLE = "circle"


@dataclass
class GuidedTask:
    """Guided within AUTO: where to (None: no place was given), since when and where it began, and its limits (0: none)."""

    place: tuple[int, int] | None = None
    height_m: float = 0.0
    began_s: float = 0.0
    began_at: tuple[int, int] = (0, 0)
    sent_s: float | None = None
    limit_s: float = 0.0
    limit_m: float = 0.0


@dataclass
class Auto:
    """AUTO's state beside the mission itself; times are seconds since boot."""

    submode: Submode = Submode.STOP
    waiting: bool = False
    reached: bool = False
    loiter_s: float = 0.0
    loitering_since_s: float = 0.0
    delay_since_s: float = 0.0
    delay_s: float = 0.0
    condition_since_s: float = 0.0
    condition: float = 0.0
    heading_rad: float = 0.0
    turned: bool = False
    turns: float = 0.0
    seen_changes: int = 0
    seen_index: int | None = None
    seen_items: Sequence[Item] = ()
    guided: GuidedTask = field(default_factory=GuidedTask)


@dataclass
class Fence:
    """Which kinds of fence watch, and which are breached (bits of FENCE_TYPE)."""

    enabled: int = 0
    seen_setting: float = 0.0
    breached: int = 0
    count: int = 0
    breach_s: float = 0.0
    told_s: float = -10.0
    backup_m: float = 0.0
    recovering_since_s: float | None = None


@dataclass
class WayBack:
    """SMART_RTL's path, metres north and east of the EKF origin, and how far along it the rover is."""

    points: list[tuple[float, float]] = field(default_factory=list)
    active: bool = False
    home_saved: bool = False
    following: bool = False
    load: bool = False
    done: bool = False
    simplified: int = 0
    saved_s: float = 0.0


@dataclass
class Plan:
    """All of it, as the vehicle holds it."""

    storage: Storage
    mission: Mission
    uploads: dict[int, Upload] = field(default_factory=dict)
    auto: Auto = field(default_factory=Auto)
    fence: Fence = field(default_factory=Fence)
    way_back: WayBack = field(default_factory=WayBack)
    warned: set[tuple[int, str]] = field(default_factory=set)
    """Complaints that were made."""
    told_arrival: bool = False
    """RTL has said that it is there."""
    way_back_due_us: int = 0
    helper: tuple[int, int, int] | None = None
    """The first onboard controller that was heard: system, component, channel."""


def new_plan(storage: Storage) -> Plan:
    """Nothing under way; mission items are those stored."""
    return Plan(storage, Mission(storage.mission))
