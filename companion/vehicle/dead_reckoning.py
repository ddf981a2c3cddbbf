"""Dead reckoning: the reported position is compared with the integral of the reported velocity.

This shows jumps, a position that is frozen, and one that drifts: a bad GPS that the EKF follows so slowly that none of
its own checks fails.

Nouns: dead reckoning.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

RECKONED_M = 1.5
FROZEN_SHARE = 0.2
"""After RECKONED_M by velocity, the position must have moved by more than this share of it."""
RECKONED_S = 10.0
"""If that takes longer, nothing is concluded: the position's noise is too large then."""

MAX_DRIFT_M = 1.0
"""How far position and velocity may differ within DRIFT_S."""
DRIFT_S, MARK_S = 5.0, 0.25
MAX_QUICK_M, QUICK_S = 0.5, 1.0
"""How far within QUICK_S. Real firmware in simulation stays below 0.08 m. A real rover with plain GPS exceeded it once
in 80 s (0.51 m), and 0.35 m in one of 100 reports."""
SETTLED_M = 0.1
"""A position that departs no farther than this within QUICK_S follows its velocity again."""


class Report(Protocol):
    """A position report: companion's and autopilot's time, metres and m/s from the EKF origin."""

    @property
    def time_s(self) -> float:
        """When it arrived, by the companion's clock."""

    @property
    def boot_s(self) -> float:
        """When it was made, by the autopilot's clock."""

    @property
    def north_m(self) -> float:
        """Place."""

    @property
    def east_m(self) -> float:
        """Place."""

    @property
    def north_m_s(self) -> float:
        """Velocity."""

    @property
    def east_m_s(self) -> float:
        """Velocity."""


@dataclass(frozen=True, slots=True)
class Reckoning:
    """The integral of the velocity since a position report, in metres."""

    since: Report
    north_m: float = 0.0
    east_m: float = 0.0


def reckoning_after(reckoning: Reckoning | None, before: Report | None, now: Report) -> tuple[Reckoning, bool]:
    """The reckoning after one more report, and whether the position is frozen although the velocity is not zero."""
    if before is None or reckoning is None or not 0.0 <= now.boot_s - reckoning.since.boot_s <= RECKONED_S:
        return Reckoning(now), False
    elapsed_s = now.boot_s - before.boot_s
    north_m = reckoning.north_m + (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = reckoning.east_m + (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    led_m = math.hypot(north_m, east_m)
    if led_m < RECKONED_M:
        return Reckoning(reckoning.since, north_m, east_m), False
    moved_m = math.hypot(now.north_m - reckoning.since.north_m, now.east_m - reckoning.since.east_m)
    return Reckoning(now), moved_m < FROZEN_SHARE * led_m


@dataclass(frozen=True, slots=True)
class Drift:
    """Position minus integrated velocity, in metres north and east: now, and every MARK_S before."""

    north_m: float = 0.0
    east_m: float = 0.0
    marks: tuple[tuple[float, float, float], ...] = ()
    """Boot time and difference then, no older than DRIFT_S."""
    off_m: float = 0.0
    """The largest change within DRIFT_S; once it is too large, the comparison starts again."""
    quick_m: float = 0.0
    """The largest change within QUICK_S."""
    settled: bool = False
    """Whether the position has followed its velocity for QUICK_S."""

    @property
    def noticed(self) -> bool:
        """Whether it is too large."""
        return self.off_m > MAX_DRIFT_M or self.quick_m > MAX_QUICK_M


def drift_after(drift: Drift, before: Report | None, now: Report) -> Drift:
    """The drift after one more report; a gap in the reports, or a clock that jumps, starts the comparison again."""
    if before is None or drift.noticed or not 0.0 < now.boot_s - before.boot_s < 1.0:
        return Drift()
    elapsed_s = now.boot_s - before.boot_s
    north_m = drift.north_m + now.north_m - before.north_m - (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = drift.east_m + now.east_m - before.east_m - (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    marks = drift.marks
    if not marks or now.boot_s - marks[-1][0] >= MARK_S:
        marks = (*(mark for mark in marks if now.boot_s - mark[0] <= DRIFT_S), (now.boot_s, north_m, east_m))
    changes_m = [(now.boot_s - at_s, math.hypot(north_m - n_m, east_m - e_m)) for at_s, n_m, e_m in marks]
    quick_m = max(change_m for age_s, change_m in changes_m if age_s <= QUICK_S)
    settled = changes_m[0][0] >= QUICK_S and quick_m <= SETTLED_M
    return Drift(north_m, east_m, marks, max(change_m for _, change_m in changes_m), quick_m, settled)


def jump_m(before: Report | None, now: Report, *, clock_jumped: bool = False) -> float:
    """The distance of a report from where the velocity led. With ``clock_jumped``, by the clock that gives less."""
    if before is None:
        return 0.0
    by_boot_m = _off_m(before, now, now.boot_s - before.boot_s)
    return min(by_boot_m, _off_m(before, now, now.time_s - before.time_s)) if clock_jumped else by_boot_m


def _off_m(before: Report, now: Report, elapsed_s: float) -> float:
    north_m = before.north_m + (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = before.east_m + (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    return math.hypot(now.north_m - north_m, now.east_m - east_m)
