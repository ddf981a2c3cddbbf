"""Flight modes, and the state of missions, fence, SMART_RTL, sticks and proximity as plain values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any

from sitl.autopilot.mission_items import Item

MISSION, FENCE, RALLY = 0, 1, 2
"""MAV_MISSION_TYPE."""


class Mode(IntEnum):
    """ArduRover's flight modes."""

    MANUAL = 0
    ACRO = 1
    STEERING = 3
    HOLD = 4
    LOITER = 5
    FOLLOW = 6
    SIMPLE = 7
    DOCK = 8
    CIRCLE = 9
    AUTO = 10
    RTL = 11
    SMART_RTL = 12
    GUIDED = 15
    INITIALISING = 16


AUTOPILOT_MODES = {Mode.LOITER, Mode.CIRCLE, Mode.AUTO, Mode.RTL, Mode.SMART_RTL, Mode.GUIDED}
"""Modes that drive by themselves and need a position."""

DRIVEN_MODES = {Mode.GUIDED, Mode.AUTO, Mode.RTL, Mode.SMART_RTL}
"""Modes that may have a place to drive to."""


@dataclass
class Clocks:
    """Times that the autopilot remembers, seconds since boot."""

    ground_station_s: float | None = None
    prearm_text_s: float = 0.0
    variance_text_s: float = 0.0
    logging_s: float = -math.inf
    """When arming was last tried, or when it ended; the log is written for some seconds after that."""


@dataclass
class CommandLog:
    """Commands that were answered (``CommandEvent``), over all boots; ``booted_s``: when the present one began."""

    events: list[Any] = field(default_factory=list)
    booted_s: float = 0.0


@dataclass
class CommandTrouble:
    """What befalls commands now, by a fault: ``commands``: their numbers (empty: all that are in the log).

    ``lost``: they do not arrive; ``unanswered``: they are done, and their answer is lost; ``result``: the answer that
    refuses them. ``left``: so many more of them; None: all.
    """

    commands: frozenset[int] = frozenset()
    lost: bool = False
    unanswered: bool = False
    result: int | None = None
    left: int | None = None

    def befalls(self, command: int) -> bool:
        """Whether it befalls this one; then it has one less left."""
        if (self.commands and command not in self.commands) or self.left == 0:
            return False
        if self.left is not None:
            self.left -= 1
        return True


@dataclass
class Proximity:
    """Obstacle distances received: the nearest in each eighth of a turn, clockwise from ahead."""

    octants_cm: list[int] = field(default_factory=list)
    limits_cm: tuple[int, int] = (0, 0)
    heard_s: float = -1.0


@dataclass
class Sticks:
    """The pilot's sticks, -1 to 1, from the transmitter or from a ground station's RC_CHANNELS_OVERRIDE."""

    steering: float = 0.0
    throttle: float = 0.0
    overridden_s: float | None = None
    """When the last override was received; once overrides stop, the transmitter counts again."""


@dataclass
class Storage:
    """Mission, fence and rally items, and the files of the SD card; they survive a reboot."""

    mission: list[Item] = field(default_factory=list)
    fence: list[Item] = field(default_factory=list)
    rally: list[Item] = field(default_factory=list)
    files: dict[str, bytearray] = field(default_factory=dict)
    open_file: str = ""
    """The file that is being written; empty for none."""


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
    """The new fence so far; it replaces the old one when it is complete."""


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
    """Guided within AUTO: the place given (or None), when and where it began, and its limits (0: none)."""

    place: tuple[int, int] | None = None
    height_m: float = 0.0
    began_s: float = 0.0
    began_at: tuple[int, int] = (0, 0)
    sent_s: float | None = None
    limit_s: float = 0.0
    limit_m: float = 0.0


@dataclass
class AutoState:
    """AUTO's state besides the mission itself; times are seconds since boot."""

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
    seen_changes: int = 0
    seen_index: int | None = None
    seen_items: Sequence[Item] = ()
    guided: GuidedTask = field(default_factory=GuidedTask)


@dataclass
class FenceState:
    """Which kinds of fence are enabled and which are breached (bits of FENCE_TYPE)."""

    enabled: int = 0
    seen_setting: float = 0.0
    breached: int = 0
    count: int = 0
    breach_s: float = 0.0
    reported_s: float = -10.0
    backup_m: float = 0.0
    recovering_since_s: float | None = None


@dataclass
class SmartRtl:
    """The path that SMART_RTL drives back, metres north and east of the EKF origin, and the progress along it."""

    points: list[tuple[float, float]] = field(default_factory=list)
    active: bool = False
    home_saved: bool = False
    load: bool = False
    done: bool = False
    simplified: int = 0
    saved_s: float = 0.0
    due_us: int = 0
    """When the next point is considered, microseconds since boot."""
