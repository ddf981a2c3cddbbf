"""Tables of a fault plan file, one per kind of fault, and their conversion to values; described in docs/faults.md."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from sitl.autopilot.payload import RESULTS, command_of_name
from sitl.faults.plan import (
    BatteryLow,
    CommandFault,
    Direction,
    Fault,
    FixName,
    GpsFixChange,
    GpsFixUntold,
    GpsGlitch,
    GpsLoss,
    GpsNoise,
    LidarFault,
    LinkEffect,
    LinkFault,
    PilotTakesOver,
    Reboot,
    SensorFault,
    Since,
    WheelSlip,
)
from sitl.sensors.range_sensors import Defect

REBOOT_S = 3.0
OVERTAKEN_S = 0.2

PILOT_MODES = ("MANUAL", "ACRO", "STEERING", "HOLD", "LOITER", "AUTO", "RTL", "SMART_RTL", "GUIDED")

Seconds = Annotated[float, Field(ge=0.0, le=1e6)]
Span = Annotated[float, Field(gt=0.0, le=1e6)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Metres = Annotated[float, Field(gt=0.0, le=1e5)]
Stick = Annotated[float, Field(ge=-1.0, le=1.0)]
Numbers = Annotated[list[Annotated[int, Field(ge=1, le=1000)]], Field(min_length=1, max_length=100)]


class FaultTable(BaseModel, ABC):
    """``[[fault]]``: keys that all kinds have in common."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    kind: str
    start_s: Seconds
    duration_s: Span | None = None
    end_s: Span | None = None
    since: Since = "boot"
    repeat_s: Span | None = None

    def window(self, duration_s: float = math.inf) -> dict[str, Any]:
        """The times; ``duration_s``: default duration. Raises ValueError if they contradict each other."""
        if self.duration_s is not None and self.end_s is not None:
            raise ValueError("duration_s and end_s are both given; use one of them")
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError(f"end_s {self.end_s:g} is not after start_s {self.start_s:g}; choose a later end_s")
        end_s = self.start_s + (duration_s if self.duration_s is None else self.duration_s)
        end_s = end_s if self.end_s is None else self.end_s
        if self.repeat_s is not None and self.repeat_s <= end_s - self.start_s:
            raise ValueError("repeat_s must be longer than the fault; give it a duration_s shorter than repeat_s")
        repeat_s = math.inf if self.repeat_s is None else self.repeat_s
        return {"start_s": self.start_s, "end_s": end_s, "since": self.since, "repeat_s": repeat_s}

    @abstractmethod
    def fault(self) -> Fault:
        """The fault as a value. Raises ValueError for contradicting keys."""


class OnLink(FaultTable):
    """Keys of link faults."""

    direction: Direction = "both"
    links: Numbers = [1]
    """All links, if a plan does not give this key."""

    def link_fault(self, effect: LinkEffect, **strength: Any) -> LinkFault:
        """The fault on the links it affects."""
        links = tuple(self.links) if "links" in self.model_fields_set else ()
        return LinkFault(**self.window(), effect=effect, direction=self.direction, links=links, **strength)


class Loss(OnLink):
    """``packet_loss``."""

    probability: Share

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(LinkEffect.LOSS, probability=self.probability)


class Delay(OnLink):
    """``packet_delay``."""

    delay_s: Annotated[float, Field(ge=0.0, le=3600.0)]
    jitter_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 0.0
    probability: Share = 1.0

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(
            LinkEffect.DELAY, probability=self.probability, delay_s=self.delay_s, jitter_s=self.jitter_s
        )


class Reorder(OnLink):
    """``packet_reorder``."""

    probability: Share
    delay_s: Annotated[float, Field(gt=0.0, le=3600.0)] = OVERTAKEN_S

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(LinkEffect.REORDER, probability=self.probability, delay_s=self.delay_s)


class Duplicate(OnLink):
    """``packet_duplicate``."""

    probability: Share

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(LinkEffect.DUPLICATE, probability=self.probability)


class Corrupt(OnLink):
    """``packet_corrupt``."""

    probability: Share

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(LinkEffect.CORRUPT, probability=self.probability)


class Outage(OnLink):
    """``link_outage``."""

    def fault(self) -> Fault:
        """As a value."""
        return self.link_fault(LinkEffect.OUTAGE)


class RebootTable(FaultTable):
    """``autopilot_reboot``."""

    def fault(self) -> Fault:
        """As a value."""
        return Reboot(**self.window(REBOOT_S))


class PilotTable(FaultTable):
    """``pilot``."""

    mode: str
    steering: Stick = 0.0
    throttle: Stick = 0.0

    def fault(self) -> Fault:
        """As a value. Raises ValueError for a mode that is not on the switch, and for sticks without effect."""
        if self.mode not in PILOT_MODES:
            raise ValueError(f"mode: unknown mode {self.mode!r:.40}; modes are {', '.join(PILOT_MODES)}")
        if self.mode != "MANUAL" and (self.steering or self.throttle):
            raise ValueError(
                f'steering and throttle have no effect in {self.mode}; use mode = "MANUAL" or leave them out'
            )
        return PilotTakesOver(**self.window(), mode=self.mode, steering=self.steering, throttle=self.throttle)


class GpsLossTable(FaultTable):
    """``gps_loss``."""

    def fault(self) -> Fault:
        """As a value."""
        return GpsLoss(**self.window())


class GpsGlitchTable(FaultTable):
    """``gps_glitch``."""

    metres: Metres
    bearing_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None

    def fault(self) -> Fault:
        """As a value."""
        return GpsGlitch(**self.window(), metres=self.metres, bearing_deg=self.bearing_deg)


class GpsFixTable(FaultTable):
    """``gps_fix``."""

    fix: str
    metres: Annotated[float, Field(ge=0.0, le=1e5)] = 0.0
    bearing_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None

    def fault(self) -> Fault:
        """As a value. Raises ValueError for a fix that is none, and for an error of a position that is not there."""
        names = [name.value for name in FixName]
        if self.fix not in names:
            raise ValueError(f"fix: unknown fix {self.fix!r:.40}; fixes are {', '.join(names)}")
        if self.fix == FixName.NONE.value and self.metres:
            raise ValueError('metres has no effect without a position; leave it out, or use fix = "rtk-float"')
        bearing_deg = self.bearing_deg
        return GpsFixChange(**self.window(), fix=FixName(self.fix), metres=self.metres, bearing_deg=bearing_deg)


class GpsFixUntoldTable(FaultTable):
    """``gps_fix_untold``."""

    def fault(self) -> Fault:
        """As a value."""
        return GpsFixUntold(**self.window())


class GpsNoiseTable(FaultTable):
    """``gps_noise``."""

    metres: Metres
    time_s: Annotated[float, Field(ge=0.1, le=3600.0)] = GpsNoise().time_s

    def fault(self) -> Fault:
        """As a value."""
        return GpsNoise(**self.window(), metres=self.metres, time_s=self.time_s)


class Stuck(FaultTable):
    """``sensor_stuck``; ``in_view``: from the first reading that shows something."""

    beams: Numbers | None = None
    in_view: bool = False

    def fault(self) -> Fault:
        """As a value."""
        defect = Defect.STUCK_IN_VIEW if self.in_view else Defect.STUCK
        return SensorFault(**self.window(), defect=defect, beams=tuple(self.beams or ()))


class Silent(FaultTable):
    """``sensor_silent``."""

    beams: Numbers | None = None

    def fault(self) -> Fault:
        """As a value."""
        return SensorFault(**self.window(), defect=Defect.SILENT, beams=tuple(self.beams or ()))


class OnLidar(FaultTable):
    """Keys of faults of lidars on serial lines."""

    lidars: Numbers | None = None

    def lidar_fault(self, **strength: Any) -> LidarFault:
        """The fault of the lidars that it concerns."""
        return LidarFault(**self.window(), lidars=tuple(self.lidars or ()), **strength)


class LidarLoss(OnLidar):
    """``lidar_loss``."""

    probability: Share

    def fault(self) -> Fault:
        """As a value."""
        return self.lidar_fault(lost=self.probability)


class LidarDamage(OnLidar):
    """``lidar_corrupt``."""

    probability: Share

    def fault(self) -> Fault:
        """As a value."""
        return self.lidar_fault(damaged=self.probability)


class LidarNoise(OnLidar):
    """``lidar_noise``."""

    metres: Metres

    def fault(self) -> Fault:
        """As a value."""
        return self.lidar_fault(noise_m=self.metres)


class LidarStalled(OnLidar):
    """``lidar_stalled``."""

    def fault(self) -> Fault:
        """As a value."""
        return self.lidar_fault(stalled=True)


class LidarUnplugged(OnLidar):
    """``lidar_unplugged``."""

    def fault(self) -> Fault:
        """As a value."""
        return self.lidar_fault(unplugged=True)


class SlipTable(FaultTable):
    """``wheel_slip``."""

    share: Share
    side: Literal["both", "left", "right"] = "both"

    def fault(self) -> Fault:
        """As a value."""
        return WheelSlip(**self.window(), share=self.share, side=self.side)


class BatteryTable(FaultTable):
    """``battery_low``."""

    volts: Annotated[float, Field(gt=0.0, le=100.0)] = BatteryLow().volts

    def fault(self) -> Fault:
        """As a value."""
        return BatteryLow(**self.window(), volts=self.volts)


class CommandTable(FaultTable):
    """``command``: what befalls the mission's commands at the autopilot."""

    effect: Literal["refused", "lost", "unanswered"]
    commands: Annotated[list[str], Field(min_length=1, max_length=100)] | None = None
    result: Literal["failed", "denied", "unsupported", "temporarily rejected"] = "failed"
    times: Annotated[int, Field(ge=1, le=1_000_000)] | None = None

    def fault(self) -> Fault:
        """As a value. Raises ValueError for a command that is not known, and for a result of what is not refused."""
        if self.effect != "refused" and "result" in self.model_fields_set:
            raise ValueError('result goes with effect = "refused"; leave it out')
        numbers = tuple(command_of_name(name) for name in self.commands or ())
        result = next(number for number, name in RESULTS.items() if name == self.result)
        return CommandFault(**self.window(), effect=self.effect, commands=numbers, result=result, times=self.times)


KINDS: dict[str, type[FaultTable]] = {
    "packet_loss": Loss,
    "packet_delay": Delay,
    "packet_reorder": Reorder,
    "packet_duplicate": Duplicate,
    "packet_corrupt": Corrupt,
    "link_outage": Outage,
    "autopilot_reboot": RebootTable,
    "pilot": PilotTable,
    "gps_loss": GpsLossTable,
    "gps_glitch": GpsGlitchTable,
    "gps_noise": GpsNoiseTable,
    "gps_fix": GpsFixTable,
    "gps_fix_untold": GpsFixUntoldTable,
    "sensor_stuck": Stuck,
    "sensor_silent": Silent,
    "lidar_loss": LidarLoss,
    "lidar_corrupt": LidarDamage,
    "lidar_noise": LidarNoise,
    "lidar_stalled": LidarStalled,
    "lidar_unplugged": LidarUnplugged,
    "wheel_slip": SlipTable,
    "battery_low": BatteryTable,
    "command": CommandTable,
}


class PlanTable(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    seed: Annotated[int, Field(ge=0, le=2**31)] = 0
    fault: Annotated[list[dict[str, Any]], Field(max_length=1000)] = []
