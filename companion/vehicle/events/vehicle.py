"""What the autopilot tells of the vehicle, and others of themselves."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from companion.core.frames import GeoPoint
from companion.core.scan import RangeScan


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
    """Somebody else told where he is: GLOBAL_POSITION_INT of another system, ADSB_VEHICLE or AIS_VESSEL.

    ``seen_s``: when he was there, by the companion's clock; ``radius_m``: half his largest extent, None if not told.
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
class EkfStatusSeen:
    """EKF_STATUS_REPORT flags."""

    time_s: float
    flags: int


@dataclass(frozen=True, slots=True)
class OriginSeen:
    """GPS_GLOBAL_ORIGIN: where the local frame begins."""

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
    """POSITION_TARGET_GLOBAL_INT: what the autopilot really follows."""

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
