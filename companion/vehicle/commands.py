"""What the companion can ask of the autopilot, as plain values; only the codec knows their bytes."""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.frames import NedPoint
from companion.vehicle.events.plan import PlanKind
from companion.vehicle.events.targets import Asker, TargetAnswer, TargetForm


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """Here I am: component 191, an onboard controller."""


@dataclass(frozen=True, slots=True)
class SetMode:
    """Change the flight mode (ArduRover's number)."""

    mode: int


@dataclass(frozen=True, slots=True)
class Arm:
    """Arm the motors."""


@dataclass(frozen=True, slots=True)
class GuidedPosition:
    """Drive to a place in the local frame (from the EKF origin)."""

    point: NedPoint


@dataclass(frozen=True, slots=True)
class GuidedVelocity:
    """Drive along the rover's own axis at this speed (negative: backwards) with this turn rate, clockwise.

    The autopilot stops by itself 3 s after the last one.
    """

    forward_m_s: float
    yaw_rate_rad_s: float


@dataclass(frozen=True, slots=True)
class GuidedHeading:
    """Turn on the spot to a heading, clockwise from north."""

    heading_rad: float


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Cruise speed for the present position target."""

    speed_m_s: float


@dataclass(frozen=True, slots=True)
class RequestRate:
    """Stream a message at a rate."""

    message_id: int
    rate_hz: float


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """Send one message now."""

    message_id: int


@dataclass(frozen=True, slots=True)
class AskPrearm:
    """Have the autopilot check whether it could be armed, and say what is in the way. Nothing moves."""


@dataclass(frozen=True, slots=True)
class AskTime:
    """TIMESYNC: the answer brings ``asked_ns`` back, nanoseconds of our own clock."""

    asked_ns: int


@dataclass(frozen=True, slots=True)
class ReadParameter:
    """Read one parameter by name."""

    name: str


@dataclass(frozen=True, slots=True)
class RequestList:
    """Tell how many items a stored list has."""

    kind: PlanKind


@dataclass(frozen=True, slots=True)
class RequestItem:
    """Tell one item of a stored list."""

    kind: PlanKind
    index: int


@dataclass(frozen=True, slots=True)
class EndTransfer:
    """The transfer of a stored list is over: all has arrived, or (``cancelled``) no more is wanted."""

    kind: PlanKind
    cancelled: bool = False


@dataclass(frozen=True, slots=True)
class TellParameter:
    """One of the companion's own parameters, at its place in the list of ``count``."""

    name: str
    value: float
    index: int
    count: int
    whole_number: bool = False


@dataclass(frozen=True, slots=True)
class TellFigure:
    """A figure for people to watch; its name has at most 10 characters."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Say:
    """Text for the people at the ground station; severity as in MAVLink (6 info, 4 warning, 2 critical)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class AnswerTarget:
    """What becomes of a guided target that somebody asked of the companion; to him alone."""

    asker: Asker
    form: TargetForm
    answer: TargetAnswer


Setpoint = GuidedPosition | GuidedVelocity | GuidedHeading
Command = (
    Heartbeat
    | SetMode
    | Arm
    | GuidedPosition
    | GuidedVelocity
    | GuidedHeading
    | ChangeSpeed
    | RequestRate
    | RequestMessage
    | AskTime
    | AskPrearm
    | ReadParameter
    | RequestList
    | RequestItem
    | EndTransfer
    | Say
    | AnswerTarget
    | TellParameter
    | TellFigure
)

__all__ = [
    "AnswerTarget",
    "Arm",
    "AskPrearm",
    "AskTime",
    "ChangeSpeed",
    "Command",
    "EndTransfer",
    "GuidedHeading",
    "GuidedPosition",
    "GuidedVelocity",
    "Heartbeat",
    "ReadParameter",
    "RequestItem",
    "RequestList",
    "RequestMessage",
    "RequestRate",
    "Say",
    "SetMode",
    "Setpoint",
    "TellFigure",
    "TellParameter",
]
