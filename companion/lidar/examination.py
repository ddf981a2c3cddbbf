"""What the doctor finds about lidars that are wired to the companion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.scan import RangeScan
from companion.diagnosis.finding import Finding, Level
from companion.lidar.reader import LidarCounters
from companion.lidar.trouble import LidarTrouble

BAD_SHARE = 0.02
ECHO_SHARE = 0.05
SLOW_HZ = 3.0
OWN_BODY_M = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class LidarHeard:
    """What was heard of one lidar within ``seconds``; ``scan``: the newest, None if there was none.

    ``trouble``: why there was none, or none that tells anything.
    """

    name: str
    port: str
    seconds: float
    counters: LidarCounters
    scan: RangeScan | None
    trouble: LidarTrouble | None = None

    @property
    def described(self) -> str:
        """A line for people."""
        if self.scan is None:
            return f"{self.name} on {self.port}: no whole turn"
        counted, hit = self.counters, np.isfinite(self.scan.range_m)
        echoes = f"{counted.echoes / counted.points:.0%} of them with an echo"
        rate = f"{counted.scans / self.seconds:.1f} turns a second, {len(self.scan.range_m)} readings each, {echoes}"
        if not hit.any():
            return f"{self.name} on {self.port}: {rate}"
        nearest = int(np.nanargmin(np.where(hit, self.scan.range_m, np.nan)))
        where_deg = np.degrees(self.scan.bearing_rad[nearest]) % 360.0
        return (
            f"{self.name} on {self.port}: {rate}, nearest {self.scan.range_m[nearest]:.2f} m at {where_deg:.0f} degrees"
        )


def lidar_findings(heard: Sequence[LidarHeard], *, others_look_ahead: bool) -> Iterator[Finding]:
    """What is wrong with them. ``others_look_ahead``: whether range data over the link covers straight ahead."""
    for one in heard:
        yield from _findings(one)
    scans = [one.scan for one in heard if one.scan is not None]
    ahead = others_look_ahead or any(scan.looks_ahead for scan in scans)
    if heard and not ahead and not any(one.trouble for one in heard):  # where such a one looks is not known
        says = "No lidar tells what is straight ahead (within 20 degrees)."
        yield Finding("not-ahead", Level.STOP, says, "look at yaw, flip and mask of --lidar")


def _findings(heard: LidarHeard) -> Iterator[Finding]:
    name, counted = f"{heard.name} on {heard.port}", heard.counters
    if heard.trouble is not None:
        yield Finding(heard.trouble.name, Level.STOP, f"{heard.trouble.says}.", heard.trouble.remedy)
    else:
        yield from _doubts(heard, name, counted)


def _doubts(heard: LidarHeard, name: str, counted: LidarCounters) -> Iterator[Finding]:
    if counted.bad_bytes > BAD_SHARE * counted.bytes:
        says = f"{name}: {counted.bad_bytes / counted.bytes:.0%} of its bytes cannot be used."
        yield Finding("lidar-damaged", Level.WARN, says, "look at the cable, and that nothing else reads this port")
    if counted.echoes < ECHO_SHARE * counted.points:
        share = f"{counted.echoes / counted.points:.0%}"
        says = f"{name}: {share} of its readings have an echo: open ground, or it is covered or dazzled."
        remedy = "look at its window, and away from the sun; on open ground give it empty=5 (docs/lidars.md)"
        yield Finding("lidar-no-echo", Level.WARN, says, remedy)
    if counted.scans < SLOW_HZ * heard.seconds:
        says = (
            f"{name} turns {counted.scans / heard.seconds:.1f} times a second; after a second without, the rover stops."
        )
        yield Finding("lidar-slow", Level.WARN, says, "look at its power supply")
    if heard.scan is not None and bool(np.any(heard.scan.range_m < OWN_BODY_M)):
        says = f"{name} sees something nearer than {OWN_BODY_M:g} m: a part of the rover?"
        yield Finding("lidar-own-body", Level.NOTE, says, "hide it with mask=FROM..TO, or with min")
