"""A plan of faults as plain values: what goes wrong when, for how long, how badly.

Times are seconds from when the simulator was switched on, or from when the rover began to drive; a reboot of the autopilot does not
set them back.
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
    """When it is there: from ``start_s`` until ``end_s`` (inf: to the end), both counted ``since``.

    With ``repeat_s`` it comes again so long after it began, for ever.
    """

    start_s: float = 0.0
    end_s: float = math.inf
    since: Since = "boot"
    repeat_s: float = math.inf

    def at(self, elapsed_s: float) -> tuple[bool, float]:
        """Whether it is there ``elapsed_s`` after its count began, and when that changes next (inf: never)."""
        if elapsed_s < self.start_s - TINY_S:
            return False, self.start_s
        times = math.floor((elapsed_s - self.start_s + TINY_S) / self.repeat_s) if math.isfinite(self.repeat_s) else 0
        shift_s = times * self.repeat_s if times else 0.0
        if elapsed_s < self.end_s + shift_s - TINY_S:
            return True, self.end_s + shift_s
        return False, self.start_s + (times + 1) * self.repeat_s


TINY_S = 1e-6
"""A moment is reached when only so much is missing: times are sums of main loops."""


@dataclass(frozen=True, slots=True)
class LinkFault(Fault):
    """Something that befalls whole packets, each with a probability of its own.

    ``links``: numbers of links from 1, empty for all.
    """

    effect: LinkEffect = LinkEffect.LOSS
    probability: float = 1.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    """``delay``: up to so much longer, each packet differently; packets keep their order."""
    direction: Direction = "both"
    links: tuple[int, ...] = ()

    def concerns(self, link: int, direction: Direction) -> bool:
        """Whether packets on this link that go this way are meant."""
        return (not self.links or link in self.links) and self.direction in ("both", direction)


@dataclass(frozen=True, slots=True)
class Reboot(Fault):
    """The autopilot's power fails: it is off until ``end_s``, then it boots. Links are dropped."""


@dataclass(frozen=True, slots=True)
class PilotTakesOver(Fault):
    """The pilot turns the mode switch, holds the sticks so, and gives the rover back at ``end_s`` in the mode it was in."""

    mode: str = "HOLD"
    steering: float = 0.0
    throttle: float = 0.0
    """Sticks, -1 to 1; they count in MANUAL."""


@dataclass(frozen=True, slots=True)
class GpsLoss(Fault):
    """The receiver is silent."""


@dataclass(frozen=True, slots=True)
class GpsGlitch(Fault):
    """The receiver is wrong by so much. ``bearing_deg``: which way, clockwise from north; None: any, by the seed."""

    metres: float = 10.0
    bearing_deg: float | None = None


@dataclass(frozen=True, slots=True)
class GpsNoise(Fault):
    """The receiver's position wanders by so much (standard deviation), as slowly as ``time_s`` says."""

    metres: float = 1.0
    time_s: float = 10.0


@dataclass(frozen=True, slots=True)
class SensorFault(Fault):
    """Range sensors repeat their last reading (``stuck``) or give none (``silent``); ``stuck in view``: each from the first reading on
    that shows something.

    ``beams``: numbers of the suite's rangefinders from 1; empty for all, and for the lidar.
    """

    defect: Defect = Defect.SILENT
    beams: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class WheelSlip(Fault):
    """Wheels spin: ``share`` of what the motors give is lost, on one side or both."""

    share: float = 0.5
    side: Literal["both", "left", "right"] = "both"


@dataclass(frozen=True, slots=True)
class BatteryLow(Fault):
    """The battery's voltage at rest is so low."""

    volts: float = 10.0


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """Everything that goes wrong. ``seed`` goes with the run's own into the faults' randomness."""

    faults: tuple[Fault, ...] = ()
    seed: int = 0
    source: str = ""
