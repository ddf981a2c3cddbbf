"""Reasons and run phases as enums, with their texts.

They say why the rover must not move, what is awaited, what is wrong with a setpoint, what the run does and why it
ended. The program compares the enums. People, records and the autopilot get the texts.

Nouns: doubt, setpoint fault, wait reason, end reason, refusal, run phase, activity.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar


class Doubt(Enum):
    """Why the rover must not move now."""

    STICKS_MOVED = "the sticks were moved"
    DATA_MISSING = "no {}"
    DATA_OLD = "{} silent for over {:g} s"
    EKF_INCOMPLETE = "the autopilot's EKF has no {}"
    CLOCK_JUMPED = "the autopilot's clock has jumped"
    LINK_LATE = "the link is more than {:g} s late"
    AUTOPILOT_RESTARTED = "the autopilot's clock has run back"
    POSITION_FROZEN = "position stands still while the velocity says otherwise"
    POSITION_WANDERS = "position wanders"
    POSITION_WANDERED = "position wandered"
    POSITION_SETTLES = "position has wandered and does not follow its velocity yet"
    POSITION_JUMPED = "position jumped"
    MAP_EMPTY = "the map has begun anew, and nothing is on it yet"
    ORIGIN_MOVED = "the autopilot's EKF origin moved"
    FIX_CHANGED = "position steps with the GPS fix"
    GPS_POOR = "GPS fix {}, {} needed"
    GPS_SILENT = "GPS fix not told for over {:g} s"
    GPS_SETTLES = "GPS fix {}, not yet for {:g} s"
    LOOP_STOOD_STILL = "the companion's program stood still"
    LOOP_LATE = "the companion is too slow"
    PLANNING_LONG = "planning has taken over {:g} s"
    SCAN_REPEATED = "{} repeats itself"
    LIDAR_BLIND = "{} has seen nothing for over {:g} s (on open ground: empty=5)"
    LIDAR_LATE = "{} later than {:g} s"
    OTHER_COMPANION = "another companion drives this rover"
    TIMEOUT_LONG = "GUID_TIMEOUT is {:g} s: a velocity would go on for too long (set 1 to 3)"
    FENCE_BREACHED = "the autopilot's fence is breached"
    BEYOND_BORDER = "the rover is beyond the border of {}"
    WAITED_TOO_LONG = "waited too long for {}"
    """Of a rover that an earlier run left armed in GUIDED."""


WAITED_OUT = frozenset(
    (
        Doubt.POSITION_SETTLES,
        Doubt.MAP_EMPTY,
        Doubt.FIX_CHANGED,
        Doubt.GPS_POOR,
        Doubt.GPS_SILENT,
        Doubt.GPS_SETTLES,
    )
)
"""The rover stands as long as these last, and HOLD does not follow: it goes on by itself."""


class SetpointFault(Enum):
    """What is wrong with a setpoint, so that it is not sent."""

    BEYOND_HORIZON = "target farther away than the horizon"
    BEHIND_OBSTACLE = "target behind something"
    ON_UNSEEN_GROUND = "target on ground not seen"
    NOT_A_NUMBER = "velocity is not a number"
    INTO_OBSTACLE = "velocity leads into something"
    TURNS_INTO_OBSTACLE = "turning leads into something"
    ONTO_UNSEEN = "velocity leads onto ground not seen"
    OVER_BORDER = "setpoint leads over the border of {}"


class LatchReason(Enum):
    """Why the mode latch keeps the companion from driving."""

    OTHER_MODE = "mode is not {}"
    PAUSED = "paused on request"
    RESTARTED = "autopilot restarted, rover disarmed"
    BETWEEN_LEGS = "AUTO goes on by itself"
    DISARMED = "disarmed"
    HOLD_SENT = "HOLD was asked for"
    HOLD_LOST = "the first HOLD was not taken"


class WaitReason(Enum):
    """What is awaited before the companion drives, or drives again."""

    HEARTBEAT = "the autopilot's heartbeat{}"
    """The figure tells in words where the companion listens."""
    ORIGIN_AND_HOME = "the autopilot's origin and home (they come once its GPS and EKF are ready)"
    GOOD_DATA = "good data ({})"
    FENCE = "the autopilot's fence and rally points{}"
    OTHER_COMPANION_SILENT = "another companion with the same component id to fall silent"
    OTHER_COMPANION_SIGNS = "signs of another companion (the rover is armed in GUIDED)"
    CHARGED_BATTERY = "a charged battery ({})"
    ROOM_TO_BORDER = "the rover to stand {}"
    ON_THE_GRID = "the rover to stand on the mission's grid"
    REQUEST_TO_BEGIN = "a person to ask it to go on (a pause was asked for before the mission began)"
    GUARD_TELLS = "the guard to tell whether it has put HOLD, or a person to set GUIDED"
    GUIDED = "GUIDED (asked for)"
    ARMING = "arming (asked for; the autopilot says if it refuses)"
    PERSON_STARTS_AUTO = "a person to arm and to set AUTO (the autopilot drives this mission)"
    PERSON_SETS_GUIDED = "a person to set GUIDED (somebody is driving)"
    PERSON_SETS_GUIDED_AGAIN = "a person to set GUIDED (the rover was taken over, or stopped in doubt)"
    PERSON_ARMS = "a person to arm (or run with --arm)"
    AUTOPILOT_HEARD = "the autopilot to be heard again"
    PERSON_SETS_MODE = "a person to set {}"
    REQUEST_TO_GO_ON = "a person to ask it to go on, or to set {}"
    PERSON_ARMS_AGAIN = "a person to arm"
    PERSON_SETS_MODE_AND_ARMS = "a person to set {} and arm"
    GOOD_DATA_AND = "good data ({}) and {}"


FOR_A_PERSON = frozenset((
    WaitReason.REQUEST_TO_BEGIN,
    WaitReason.PERSON_STARTS_AUTO,
    WaitReason.PERSON_SETS_GUIDED,
    WaitReason.PERSON_SETS_GUIDED_AGAIN,
    WaitReason.PERSON_ARMS,
    WaitReason.PERSON_SETS_MODE,
    WaitReason.REQUEST_TO_GO_ON,
    WaitReason.PERSON_ARMS_AGAIN,
    WaitReason.PERSON_SETS_MODE_AND_ARMS,
))  # fmt: skip


class PowerReason(Enum):
    """Why a battery is too low; the first figure names the battery."""

    CHARGE = "{} at {} %"
    VOLTAGE = "{} at {:.1f} V"
    LOW = "{} low for the autopilot"
    CRITICAL = "{} critical for the autopilot"


class EndReason(Enum):
    """Why the run ends."""

    DONE = "done"
    STOPPED_BY_USER = "stopped by the user"
    TERMINATED = "told to end by a signal"
    """SIGTERM, as a service manager sends it, or a terminal that was closed."""
    NOBODY_HERE = "nobody is here to do what the companion waits for"
    NEVER_BEGINS = "{} since the start; it cannot be expected any more"
    TIME_LIMIT = "time limit reached"
    """Of a simulated drive, as the two before."""
    ERROR = "an error in the program"
    GONE = "the companion's program is gone: killed, or crashed"
    """As the process of the page sees it."""
    BATTERY = "{}"


class Parting(Enum):
    """How a run leaves the rover, where a person who walks up to it must know."""

    ARMED = "the rover was left armed, in {}"
    NOT_HELD = "the rover was left armed, and has not confirmed HOLD"
    SILENT = "the autopilot is silent: whether the rover stands is not known"


class Refusal(Enum):
    """Why what a person asks for is not done."""

    MALFORMED = "{}"
    """The request itself is wrong; the figure says how."""
    NOT_DRIVING = "not driving ({})"
    NO_POSITION = "no position"
    RETURNING = "the rover is on its way back"
    ENDED = "the mission is over"
    TOO_FAR = "{} m away, farther than {:g} m"
    OFF_THE_GRID = "outside the mission's grid"
    BEYOND_BORDER = "beyond {}"
    NEAR_BORDER = "it must be {}"
    CLOSED = "in or too near a fence or a known obstacle"
    OBSTACLE_SEEN = "an obstacle was seen there"
    NOT_PAUSED = "it was not paused by a request: set {} with ground station or transmitter"
    NOT_HEARD = "the autopilot is not heard"
    HOLD_NOT_HEARD = "HOLD was sent, but the autopilot is not heard: take the rover over if it moves"
    DISARMED = "the rover is disarmed"
    LEGS_OF_AUTO = "AUTO says which target is next"
    NOT_NEXT = "only the target after this one may be next"


Kind_co = TypeVar("Kind_co", bound=Enum, covariant=True)


@dataclass(frozen=True, slots=True)
class Reason(Generic[Kind_co]):
    """A reason and the figures (numbers, names, other reasons) of its text."""

    kind: Kind_co
    figures: tuple[object, ...] = ()

    def __str__(self) -> str:
        """The reason in words."""
        return str(self.kind.value).format(*self.figures)


class RunPhase(Enum):
    """What the run does now. ``{reason}`` and ``{awaited}`` are those of the ``Activity``."""

    CONNECTING = "connecting"
    WAITING = "waiting for {awaited}"
    DRIVING = "driving"
    STAYING = "staying at the target"
    WAY_BLOCKED = "waiting for the way to clear"
    STOPPED = "stopped: {reason}"
    STOPPED_AND_WAITING = "stopped: {reason}, waiting for {awaited}"
    ENDED = "{reason}"


@dataclass(frozen=True, slots=True)
class Activity:
    """What the run does at one moment, and why."""

    phase: RunPhase
    reason: Reason[Enum] | None = None
    """Why it is stopped or has ended; None while nobody has had the rover."""
    awaited: Reason[WaitReason] | None = None

    def __str__(self) -> str:
        """For people."""
        return self.phase.value.format(reason=self.reason or "", awaited=self.awaited or "")

    @property
    def needs_person(self) -> bool:
        """Whether it goes on only when a person does something, and nothing else is awaited."""
        return self.awaited is not None and self.awaited.kind in FOR_A_PERSON
