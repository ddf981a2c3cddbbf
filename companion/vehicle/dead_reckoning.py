"""Where the velocity has led, beside where the position says that the rover is.

So are noticed: jumps, a position that stands still, and one that wanders: a bad GPS that the EKF follows slowly, so that none of
its own checks strikes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

RECKONED_M = 1.5
FROZEN_SHARE = 0.2
"""Where the velocity says that the rover has gone so far, its position must have moved by more than this share of it."""
RECKONED_S = 10.0
"""Slower than this nothing is concluded: the position wanders."""

WANDERED_M = 1.0
"""So far may the position leave the way on which the velocity has led, within WANDER_S."""
WANDER_S, MARK_S = 5.0, 0.5


class Report(Protocol):
    """A position report: our clock and the autopilot's, metres and m/s from the EKF origin."""

    @property
    def time_s(self) -> float:
        """When it was heard, by our clock."""

    @property
    def boot_s(self) -> float:
        """When it was made, by the autopilot's."""

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
class Reckoned:
    """Where the velocity has led from a position report on, in metres."""

    since: Report
    north_m: float = 0.0
    east_m: float = 0.0


def reckoned(sofar: Reckoned | None, before: Report | None, now: Report) -> tuple[Reckoned, bool]:
    """The check after one more report, and whether the position has stood still though the velocity said otherwise."""
    if before is None or sofar is None or not 0.0 <= now.boot_s - sofar.since.boot_s <= RECKONED_S:
        return Reckoned(now), False
    elapsed_s = now.boot_s - before.boot_s
    north_m = sofar.north_m + (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = sofar.east_m + (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    led_m = math.hypot(north_m, east_m)
    if led_m < RECKONED_M:
        return Reckoned(sofar.since, north_m, east_m), False
    moved_m = math.hypot(now.north_m - sofar.since.north_m, now.east_m - sofar.since.east_m)
    return Reckoned(now), moved_m < FROZEN_SHARE * led_m


@dataclass(frozen=True, slots=True)
class Wander:
    """How far the position lies from where the velocity has led, metres north and east, now and every MARK_S before."""

    north_m: float = 0.0
    east_m: float = 0.0
    marks: tuple[tuple[float, float, float], ...] = ()
    """Boot time and distance then, not older than WANDER_S."""
    off_m: float = 0.0
    """How far it has wandered; once more than WANDERED_M, it begins anew from there."""

    @property
    def noticed(self) -> bool:
        """Whether it is too far."""
        return self.off_m > WANDERED_M


def wandered(wander: Wander, before: Report | None, now: Report) -> Wander:
    """After one more report; a pause in the reports, or a clock that jumps, begins it anew."""
    if before is None or wander.noticed or not 0.0 < now.boot_s - before.boot_s < 1.0:
        return Wander()
    elapsed_s = now.boot_s - before.boot_s
    north_m = wander.north_m + now.north_m - before.north_m - (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = wander.east_m + now.east_m - before.east_m - (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    marks = wander.marks
    if not marks or now.boot_s - marks[-1][0] >= MARK_S:
        marks = (*(mark for mark in marks if now.boot_s - mark[0] <= WANDER_S), (now.boot_s, north_m, east_m))
    return Wander(north_m, east_m, marks, max(math.hypot(north_m - mark[1], east_m - mark[2]) for mark in marks))


def jump_m(before: Report | None, now: Report, *, clock_jumped: bool = False) -> float:
    """How far a report lies from where the velocity led. When the autopilot's clock has jumped, by whichever clock is kinder."""
    if before is None:
        return 0.0
    by_boot_m = _off_m(before, now, now.boot_s - before.boot_s)
    return min(by_boot_m, _off_m(before, now, now.time_s - before.time_s)) if clock_jumped else by_boot_m


def _off_m(before: Report, now: Report, elapsed_s: float) -> float:
    north_m = before.north_m + (before.north_m_s + now.north_m_s) / 2.0 * elapsed_s
    east_m = before.east_m + (before.east_m_s + now.east_m_s) / 2.0 * elapsed_s
    return math.hypot(now.north_m - north_m, now.east_m - east_m)
