"""Commands and messages to the autopilot and ground stations, as plain values; the codec makes packets of them.

Nouns: setpoint, command.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.frames import NedPoint
from companion.core.severity import Severity
from companion.vehicle.events import Asker, PlanKind, RequestAnswer, RequestForm


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT of the companion: component 191, an onboard controller."""


@dataclass(frozen=True, slots=True)
class SetMode:
    """Change the flight mode (ArduRover's number)."""

    mode: int


@dataclass(frozen=True, slots=True)
class Arm:
    """Arm the motors."""


@dataclass(frozen=True, slots=True)
class GuidedPosition:
    """Drive to a place in the local frame (metres from the EKF origin)."""

    point: NedPoint


@dataclass(frozen=True, slots=True)
class GuidedVelocity:
    """Drive forwards (negative: backwards) with a turn rate, clockwise.

    The autopilot stops 3 s after the last one, or as GUID_TIMEOUT says.
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
    """Have a message sent at a rate."""

    message_id: int
    rate_hz: float


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """Have a message sent once, now."""

    message_id: int


@dataclass(frozen=True, slots=True)
class RunPrearmChecks:
    """Have the autopilot run its pre-arm checks and report failures. Nothing moves."""


@dataclass(frozen=True, slots=True)
class TimeSync:
    """TIMESYNC: the answer returns ``asked_ns``, nanoseconds of the companion's clock."""

    asked_ns: int


@dataclass(frozen=True, slots=True)
class ReadParameter:
    """Read one parameter by name."""

    name: str


@dataclass(frozen=True, slots=True)
class RequestList:
    """Ask how many items a stored list has."""

    kind: PlanKind


@dataclass(frozen=True, slots=True)
class RequestItem:
    """Ask for one item of a stored list."""

    kind: PlanKind
    index: int


@dataclass(frozen=True, slots=True)
class EndTransfer:
    """End the transfer of a stored list: complete, or ``cancelled``."""

    kind: PlanKind
    cancelled: bool = False


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """PARAM_VALUE: one of the companion's own parameters, with its index in the list of ``count``."""

    name: str
    value: float
    index: int
    count: int
    whole_number: bool = False


@dataclass(frozen=True, slots=True)
class FileRequest:
    """FILE_TRANSFER_PROTOCOL: ``payload`` is header and data."""

    payload: bytes


@dataclass(frozen=True, slots=True)
class NamedValue:
    """NAMED_VALUE_FLOAT: a figure for ground stations; its name has at most 10 characters."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT: a text for the people at the ground station."""

    severity: Severity
    text: str


@dataclass(frozen=True, slots=True)
class AnswerRequest:
    """The answer to a request to the companion; sent to the asker alone. ``reason``: why not; it goes as a text."""

    asker: Asker
    form: RequestForm
    answer: RequestAnswer
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RunCommand:
    """A command of the mission (``number``: MAV_CMD), with p1 to p7 (None: not given).

    With a ``place`` (latitude, longitude) it goes as COMMAND_INT in ``frame``, otherwise as COMMAND_LONG.
    ``repetition`` counts from 0.
    """

    number: int
    params: tuple[float | None, ...]
    place: tuple[float, float] | None = None
    frame: int = 0
    repetition: int = 0


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
    | TimeSync
    | RunPrearmChecks
    | ReadParameter
    | RequestList
    | RequestItem
    | EndTransfer
    | FileRequest
    | StatusText
    | AnswerRequest
    | RunCommand
    | ParameterValue
    | NamedValue
)
