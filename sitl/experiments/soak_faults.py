"""Random plans of faults: what a rover may meet on a bad day. Each ends by itself, so that there is a way on.

A sensor that is stuck while it sees nothing cannot be told from one over open ground (docs/safety.md): here it has
something in view.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sitl.faults.plan import (
    BatteryLow,
    Fault,
    FaultPlan,
    GpsGlitch,
    GpsLoss,
    GpsNoise,
    LinkEffect,
    LinkFault,
    PilotTakesOver,
    Reboot,
    SensorFault,
    WheelSlip,
)
from sitl.sensors.range_sensors import Defect

Make = Callable[[np.random.Generator, float], Fault]
"""Draws a fault that begins then, seconds after the rover has begun to drive."""

LATEST_S = 120.0
MOST = 4


def plan_of(rng: np.random.Generator) -> FaultPlan:
    """None to four faults of different kinds, at any time in the first two minutes of the drive."""
    names = rng.permutation(list(FAULTS))[: int(rng.integers(MOST + 1))]
    return FaultPlan(tuple(FAULTS[str(name)](rng, float(rng.uniform(0.0, LATEST_S))) for name in names))


def _link(effect: LinkEffect, longest_s: float, *, probability: float = 1.0, delay_s: float = 0.0) -> Make:
    """``probability``, ``delay_s``: at most; 1 is always."""

    def made(rng: np.random.Generator, start_s: float) -> Fault:
        end_s = start_s + rng.uniform(0.5, longest_s)
        share = float(rng.uniform(0.02, probability)) if probability < 1.0 else 1.0
        late_s = float(rng.uniform(0.05, delay_s)) if delay_s else 0.0
        more_s = late_s / 2.0 if effect is LinkEffect.DELAY else 0.0
        return LinkFault(start_s, end_s, "driving", effect=effect, probability=share, delay_s=late_s, jitter_s=more_s)

    return made


def _sensor(defect: Defect) -> Make:
    def made(rng: np.random.Generator, start_s: float) -> Fault:
        return SensorFault(start_s, start_s + rng.uniform(0.5, 8.0), "driving", defect=defect)

    return made


def _pilot(rng: np.random.Generator, start_s: float) -> Fault:
    mode = ("HOLD", "MANUAL")[int(rng.integers(2))]
    return PilotTakesOver(start_s, start_s + rng.uniform(2.0, 15.0), "driving", mode=mode)


def _slip(rng: np.random.Generator, start_s: float) -> Fault:
    return WheelSlip(start_s, start_s + rng.uniform(3.0, 20.0), "driving", share=float(rng.uniform(0.1, 0.7)))


FAULTS: dict[str, Make] = {
    "packets lost": _link(LinkEffect.LOSS, 60.0, probability=0.3),
    "packets late": _link(LinkEffect.DELAY, 30.0, delay_s=0.8),
    "packets reordered": _link(LinkEffect.REORDER, 60.0, probability=0.3, delay_s=0.3),
    "packets twice": _link(LinkEffect.DUPLICATE, 60.0, probability=0.3),
    "packets damaged": _link(LinkEffect.CORRUPT, 60.0, probability=0.2),
    "link gone": _link(LinkEffect.OUTAGE, 12.0),
    "GPS gone": lambda rng, start_s: GpsLoss(start_s, start_s + rng.uniform(1.0, 12.0), "driving"),
    "GPS glitch": lambda rng, start_s: GpsGlitch(
        start_s, start_s + rng.uniform(1.0, 10.0), "driving", metres=float(rng.uniform(1.0, 20.0))
    ),
    "GPS noise": lambda rng, start_s: GpsNoise(
        start_s, start_s + rng.uniform(5.0, 40.0), "driving", metres=float(rng.uniform(0.1, 1.0))
    ),
    "sensor stuck": _sensor(Defect.STUCK_IN_VIEW),
    "sensor silent": _sensor(Defect.SILENT),
    "wheels slip": _slip,
    "pilot takes over": _pilot,
    "autopilot reboots": lambda rng, start_s: Reboot(start_s, start_s + rng.uniform(1.0, 4.0), "driving"),
    "battery low": lambda rng, start_s: BatteryLow(start_s, since="driving", volts=float(rng.uniform(9.8, 10.4))),
}
