"""Events from the link, as plain values: what the autopilot, ground stations and other vehicles have sent.

``time_s`` is the time of arrival by the companion's clock.

Nouns: event.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

from companion.core.frames import GeoPoint
from companion.core.scan import RangeScan
from companion.vehicle.gps_fix import GpsFix
from companion.vehicle.link_latency import TimeAnswered
from companion.vehicle.rc_input import SticksSeen

# The vehicle -----------------------------------------------------------------------------------------------------


class RoverMode(IntEnum):
    """ArduRover's flight modes that the companion names."""

    MANUAL = 0
    HOLD = 4
    AUTO = 10
    RTL = 11
    GUIDED = 15


@dataclass(frozen=True, slots=True)
class HeartbeatSeen:
    """The autopilot's HEARTBEAT (component 1)."""

    time_s: float
    mode: int
    armed: bool
    system_id: int


@dataclass(frozen=True, slots=True)
class LocalPositionSeen:
    """LOCAL_POSITION_NED: metres and m/s from the EKF origin."""

    time_s: float
    boot_s: float
    north_m: float
    east_m: float
    north_m_s: float
    east_m_s: float


@dataclass(frozen=True, slots=True)
class AttitudeSeen:
    """ATTITUDE: heading clockwise from north and its rate."""

    time_s: float
    boot_s: float
    heading_rad: float
    yaw_rate_rad_s: float


@dataclass(frozen=True, slots=True)
class GlobalPositionSeen:
    """GLOBAL_POSITION_INT."""

    time_s: float
    boot_s: float
    point: GeoPoint
    altitude_m: float | None = None
    """Above sea level."""


@dataclass(frozen=True, slots=True)
class OtherSeen:
    """The position of another vehicle: GLOBAL_POSITION_INT of another system, ADSB_VEHICLE or AIS_VESSEL.

    ``seen_s``: when it was there, by the companion's clock; ``radius_m``: half its largest extent, None if unknown.
    """

    time_s: float
    name: str
    seen_s: float
    point: GeoPoint
    north_m_s: float
    east_m_s: float
    altitude_m: float | None = None
    radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class ThrottleSeen:
    """VFR_HUD: how far the throttle is open, forwards or backwards, 0 to 1."""

    time_s: float
    share: float


@dataclass(frozen=True, slots=True)
class EkfStatusSeen:
    """EKF_STATUS_REPORT flags."""

    time_s: float
    flags: int


@dataclass(frozen=True, slots=True)
class GpsSeen:
    """GPS_RAW_INT: what the receiver says of itself. ``satellites``: None if unknown.

    ``fix_us``: the autopilot's time of the fix; 0 if it is not told.
    """

    time_s: float
    fix: GpsFix
    satellites: int | None
    fix_us: int = 0


@dataclass(frozen=True, slots=True)
class OriginSeen:
    """GPS_GLOBAL_ORIGIN: the origin of the local frame."""

    time_s: float
    point: GeoPoint


@dataclass(frozen=True, slots=True)
class HomeSeen:
    """HOME_POSITION."""

    time_s: float
    point: GeoPoint


@dataclass(frozen=True, slots=True)
class RangeSeen:
    """Range readings of any kind."""

    time_s: float
    scan: RangeScan


@dataclass(frozen=True, slots=True)
class AckSeen:
    """COMMAND_ACK (``command`` is the MAV_CMD) or MISSION_ACK (``command`` is -1, ``kind`` its MAV_MISSION_TYPE)."""

    time_s: float
    command: int
    result: int
    kind: int = 0


@dataclass(frozen=True, slots=True)
class TargetSeen:
    """POSITION_TARGET_GLOBAL_INT: the target that the autopilot follows."""

    time_s: float
    point: GeoPoint
    type_mask: int


@dataclass(frozen=True, slots=True)
class TextSeen:
    """STATUSTEXT of the autopilot."""

    time_s: float
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class GuardSeen:
    """The guard on the autopilot speaks. ``waits_s``: for so long the companion may be silent.

    ``acted``: the present HOLD is its doing.
    """

    time_s: float
    waits_s: float
    acted: bool


@dataclass(frozen=True, slots=True)
class ParameterSeen:
    """PARAM_VALUE."""

    time_s: float
    name: str
    value: float


@dataclass(frozen=True, slots=True)
class PrearmSeen:
    """The pre-arm bit of SYS_STATUS."""

    time_s: float
    ok: bool


# Fence and batteries ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FenceStatusSeen:
    """FENCE_STATUS, sent only while a fence is enabled: whether the rover is outside."""

    time_s: float
    breached: bool


@dataclass(frozen=True, slots=True)
class BatterySeen:
    """A battery, by BATTERY_STATUS; by SYS_STATUS, with ``number`` -1. None: unknown.

    ``charge_state``: MAV_BATTERY_CHARGE_STATE, the autopilot's own judgement (0 undefined, 1 ok, 2 low, 3 critical).
    ``amperes``: the current drawn from it.
    """

    time_s: float
    number: int
    volts: float | None
    percent: int | None
    charge_state: int = 0
    amperes: float | None = None


# Lists stored in the autopilot (MAVLink's mission protocol) ------------------------------------------------------


class PlanKind(IntEnum):
    """The kinds of stored lists (MAV_MISSION_TYPE)."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


@dataclass(frozen=True, slots=True)
class PlanCountSeen:
    """MISSION_COUNT to the companion: how many items a list has."""

    time_s: float
    kind: int
    count: int


@dataclass(frozen=True, slots=True)
class PlanItemSeen:
    """MISSION_ITEM_INT to the companion: one item.

    Of commands without a place the last three are p5 to p7; DO_DIGICAM commands have p5 and p6 as whole numbers.
    """

    time_s: float
    kind: int
    index: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    autocontinue: bool
    altitude_m: float = 0.0


@dataclass(frozen=True, slots=True)
class PlanChangedSeen:
    """The upload of a list by somebody else was accepted (MISSION_ACK to another system)."""

    time_s: float
    kind: int


# The autopilot's mission in AUTO ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LegSeen:
    """SET_POSITION_TARGET_GLOBAL_INT to the companion: sent once a second in AUTO at NAV_GUIDED_ENABLE (ModeAuto)."""

    time_s: float
    point: GeoPoint


GUIDED_TARGET = 0


@dataclass(frozen=True, slots=True)
class ItemReachedSeen:
    """MISSION_ITEM_REACHED: a mission item is done; item 0 (GUIDED_TARGET) stands for a guided target."""

    time_s: float
    index: int


@dataclass(frozen=True, slots=True)
class ItemCurrentSeen:
    """MISSION_CURRENT: the navigation item under way, and the number of items (None: unknown)."""

    time_s: float
    index: int
    total: int | None = None


# Requests to the companion itself --------------------------------------------------------------------------------


class RequestForm(StrEnum):
    """The message of a request, which decides the message of the answer."""

    COMMAND = "command"
    """DO_REPOSITION, answered with COMMAND_ACK."""
    ITEM = "item"
    """A guided mission item, answered with MISSION_ACK."""
    PAUSE = "pause"
    CONTINUE = "continue"
    """DO_PAUSE_CONTINUE, answered with COMMAND_ACK."""
    SKIP = "skip"
    """DO_SET_MISSION_CURRENT, answered with COMMAND_ACK."""


class RequestAnswer(StrEnum):
    """The answer to a request; a text gives the reason."""

    ACCEPTED = "accepted"
    DENIED = "denied"
    NOT_NOW = "not now"
    """The same may be accepted later."""
    BAD_FRAME = "bad frame"
    BAD_VALUE = "bad value"
    UNSUPPORTED = "unsupported"


@dataclass(frozen=True, slots=True)
class Asker:
    """The sender of a request."""

    system_id: int
    component_id: int


@dataclass(frozen=True, slots=True)
class GoalRequested:
    """DO_REPOSITION or a guided mission item, addressed to the companion itself.

    ``point`` is None when the request holds no usable place; ``fault`` and ``reason`` say why. ``speed_m_s``: None for
    the mission's speed.
    """

    time_s: float
    asker: Asker
    form: RequestForm
    point: GeoPoint | None
    speed_m_s: float | None = None
    fault: RequestAnswer = RequestAnswer.ACCEPTED
    reason: str = ""


@dataclass(frozen=True, slots=True)
class PauseAsked:
    """DO_PAUSE_CONTINUE to the companion itself: to stand (``pauses``), or to go on."""

    time_s: float
    asker: Asker
    pauses: bool


@dataclass(frozen=True, slots=True)
class TargetAsked:
    """DO_SET_MISSION_CURRENT to the companion itself: ``index`` of the target that is to be next, from 0."""

    time_s: float
    asker: Asker
    index: int


# The companion's own parameters, asked for by ground stations ----------------------------------------------------


@dataclass(frozen=True, slots=True)
class ParametersAsked:
    """PARAM_REQUEST_LIST: all of them."""

    time_s: float


@dataclass(frozen=True, slots=True)
class ParameterAsked:
    """PARAM_REQUEST_READ: one, by its place in the list, or by name where ``index`` is negative."""

    time_s: float
    name: str
    index: int


@dataclass(frozen=True, slots=True)
class ParameterChangeAsked:
    """PARAM_SET. ``to_us``: addressed to the companion's component id, not to all components."""

    time_s: float
    name: str
    value: float
    to_us: bool


ParameterRequest = ParametersAsked | ParameterAsked | ParameterChangeAsked


Event = (
    HeartbeatSeen
    | LocalPositionSeen
    | AttitudeSeen
    | ThrottleSeen
    | GlobalPositionSeen
    | OtherSeen
    | EkfStatusSeen
    | GpsSeen
    | OriginSeen
    | HomeSeen
    | RangeSeen
    | AckSeen
    | TargetSeen
    | TextSeen
    | GuardSeen
    | ParameterSeen
    | PrearmSeen
    | TimeAnswered
    | PlanCountSeen
    | PlanItemSeen
    | PlanChangedSeen
    | GoalRequested
    | PauseAsked
    | TargetAsked
    | SticksSeen
    | ParameterRequest
    | LegSeen
    | ItemReachedSeen
    | ItemCurrentSeen
    | FenceStatusSeen
    | BatterySeen
)
