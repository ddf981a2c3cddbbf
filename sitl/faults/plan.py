"""Fault plans as plain values: which faults occur, when, for how long and how severely.

Times are seconds since the simulator was switched on, or since the rover began to drive; a reboot of the autopilot
does not reset them.

Nouns: fault plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from sitl.sensors.range_sensors import Defect


class LinkEffect(Enum):
    """What a link fault does to a packet."""

    LOSS = "loss"
    DELAY = "delay"
    REORDER = "reorder"
    DUPLICATE = "duplicate"
    CORRUPT = "corrupt"
    OUTAGE = "outage"


Since = Literal["boot", "driving"]
Direction = Literal["both", "to_vehicle", "from_vehicle"]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that is active from ``start_s`` to ``end_s`` (inf: forever), both counted ``since``.

    With ``repeat_s`` it recurs at that interval, forever.
    """

    start_s: float = 0.0
    end_s: float = math.inf
    since: Since = "boot"
    repeat_s: float = math.inf

    def at(self, elapsed_s: float) -> tuple[bool, float]:
        """Whether it is active ``elapsed_s`` after its count began, and when that changes next (inf: never)."""
        if elapsed_s < self.start_s - TINY_S:
            return False, self.start_s
        times = math.floor((elapsed_s - self.start_s + TINY_S) / self.repeat_s) if math.isfinite(self.repeat_s) else 0
        shift_s = times * self.repeat_s if times else 0.0
        if elapsed_s < self.end_s + shift_s - TINY_S:
            return True, self.end_s + shift_s
        return False, self.start_s + (times + 1) * self.repeat_s


TINY_S = 1e-6
"""Tolerance when times are compared: they are sums of main loops."""


@dataclass(frozen=True, slots=True)
class LinkFault(Fault):
    """A fault that affects whole packets, each with ``probability``.

    ``links``: numbers of links from 1, empty for all.
    """

    effect: LinkEffect = LinkEffect.LOSS
    probability: float = 1.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    """For a delay: random extra delay of each packet; packets keep their order."""
    direction: Direction = "both"
    links: tuple[int, ...] = ()

    def concerns(self, link: int, direction: Direction) -> bool:
        """Whether it affects packets on this link in this direction."""
        return (not self.links or link in self.links) and self.direction in ("both", direction)


@dataclass(frozen=True, slots=True)
class Reboot(Fault):
    """The autopilot loses power: it is off until ``end_s``, then it boots. Links are dropped."""


@dataclass(frozen=True, slots=True)
class PilotTakesOver(Fault):
    """The pilot switches the mode, holds the sticks, and at ``end_s`` returns to the mode before."""

    mode: str = "HOLD"
    steering: float = 0.0
    throttle: float = 0.0
    """Sticks, -1 to 1; they have an effect in MANUAL only."""


@dataclass(frozen=True, slots=True)
class GpsLoss(Fault):
    """The GPS receiver is silent."""


@dataclass(frozen=True, slots=True)
class GpsGlitch(Fault):
    """The GPS position is wrong by ``metres`` towards ``bearing_deg``, clockwise from north (None: random)."""

    metres: float = 10.0
    bearing_deg: float | None = None


@dataclass(frozen=True, slots=True)
class GpsNoise(Fault):
    """The GPS position wanders by ``metres`` (standard deviation) with a time constant of ``time_s``."""

    metres: float = 1.0
    time_s: float = 10.0


class FixName(Enum):
    """A GPS fix, as fault plans name it."""

    NONE = "none"
    FIX_3D = "3d"
    DGPS = "dgps"
    RTK_FLOAT = "rtk-float"
    RTK_FIXED = "rtk-fixed"


@dataclass(frozen=True, slots=True)
class GpsFixChange(Fault):
    """The receiver has another fix, and its position is wrong by ``metres`` towards ``bearing_deg`` (None: random)."""

    fix: FixName = FixName.RTK_FLOAT
    metres: float = 0.0
    bearing_deg: float | None = None


@dataclass(frozen=True, slots=True)
class GpsFixUntold(Fault):
    """GPS_RAW_INT is not sent; the EKF goes on with the receiver."""


@dataclass(frozen=True, slots=True)
class SensorFault(Fault):
    """Range sensors with a defect.

    ``beams``: numbers of the suite's rangefinders, from 1; empty for all sensors, the lidar included.
    """

    defect: Defect = Defect.SILENT
    beams: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class LidarFault(Fault):
    """Something is wrong with lidars on serial lines, or with the lines. ``lidars``: numbers from 1, empty for all.

    ``lost``, ``damaged``: probability of each byte; ``noise_m``: standard deviation of further noise; ``stalled``: the
    motor stands; ``unplugged``: the cable is pulled.
    """

    lidars: tuple[int, ...] = ()
    lost: float = 0.0
    damaged: float = 0.0
    noise_m: float = 0.0
    stalled: bool = False
    unplugged: bool = False


@dataclass(frozen=True, slots=True)
class WheelSlip(Fault):
    """Wheels slip: ``share`` of the motor output is lost, on one side or both."""

    share: float = 0.5
    side: Literal["both", "left", "right"] = "both"


@dataclass(frozen=True, slots=True)
class BatteryLow(Fault):
    """The battery's voltage at rest is at most ``volts``."""

    volts: float = 10.0


@dataclass(frozen=True, slots=True)
class CommandFault(Fault):
    """Commands for servos, relays, cameras and so on fail: ``effect`` says how.

    ``commands``: MAV_CMD numbers, empty for all of them; ``result``: MAV_RESULT of a refusal; ``times``: so many of
    them, None for all.
    """

    effect: Literal["refused", "lost", "unanswered"] = "refused"
    commands: tuple[int, ...] = ()
    result: int = 4
    times: int | None = None


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """All faults of a run. ``seed``: combined with the run's own for the random draws of the faults."""

    faults: tuple[Fault, ...] = ()
    seed: int = 0
    source: str = ""
