"""How late the link is: by the autopilot's answers to TIMESYNC, and by its boot time beside our own clock.

ArduPilot answers a TIMESYNC with the sender's own time and its own: the round trip is what passes between something seen and
a stop that arrives. The boot time in every position report shows a delay on the way to us sooner than the next answer does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

KEPT = 3
"""Answers and reports that are looked at together: one late packet among them is no late link, but it is driven for."""
AHEAD_S = 1.0
"""A boot time that runs ahead of our clock by more than this, or back by more than packets overtake each other, has jumped."""
BACK_S = 5.0
DRIFT = 1e-4
"""So fast two quartz clocks may drift apart: what grows no faster is no delay, also where TIMESYNC is never answered."""


@dataclass(frozen=True, slots=True)
class TimeAnswered:
    """The autopilot's answer to our TIMESYNC. ``asked_ns``: what we asked with, nanoseconds of our clock."""

    time_s: float
    asked_ns: int


@dataclass(frozen=True, slots=True)
class Latency:
    """What is known of it; all zero until something has been heard."""

    round_trips_s: tuple[float, ...] = ()
    """The newest answers, at most KEPT."""
    shifts_s: tuple[float, ...] = ()
    """Our clock minus the autopilot's in its newest position reports, at most KEPT."""
    least_shift_s: float = math.inf
    """The same without delay: the least that was seen, or what an answer has shown; allowed to rise as clocks drift."""
    heard_s: float = math.inf
    """When the newest position report came."""
    jumped_s: float = -math.inf
    """When the autopilot's clock last jumped."""

    @property
    def longest_s(self) -> float:
        """What to drive for: the longest of the newest round trips, and the delay on the way to us if that is more."""
        return max((*self.round_trips_s, self.growth_s))

    @property
    def lasting_s(self) -> float:
        """What does not go away: the shortest of the newest round trips, and the delay on the way to us if that is more."""
        whole = len(self.round_trips_s) == KEPT
        return max(min(self.round_trips_s) if whole else 0.0, self.growth_s)

    @property
    def growth_s(self) -> float:
        """How much later position reports come now than they once did."""
        return min(self.shifts_s) - self.least_shift_s if len(self.shifts_s) == KEPT else 0.0


def answered(latency: Latency, event: TimeAnswered) -> Latency:
    """After an answer. What has come to us cannot be later than the whole round trip: the rest is the clocks' own drift."""
    round_trip_s = max(0.0, event.time_s - event.asked_ns / 1e9)
    least_s = latency.least_shift_s
    if latency.shifts_s:
        least_s = max(least_s, min(latency.shifts_s) - round_trip_s)
    return replace(latency, round_trips_s=(*latency.round_trips_s[1 - KEPT :], round_trip_s), least_shift_s=least_s)


def reported(latency: Latency, time_s: float, boot_s: float) -> Latency:
    """After a position report of the autopilot's boot time ``boot_s``, heard at ``time_s``."""
    shift_s = time_s - boot_s
    if latency.shifts_s and shift_s < latency.least_shift_s - AHEAD_S:
        return Latency(latency.round_trips_s, (shift_s,), shift_s, time_s, time_s)
    drifted_s = DRIFT * max(0.0, time_s - latency.heard_s)
    return replace(
        latency,
        shifts_s=(*latency.shifts_s[1 - KEPT :], shift_s),
        least_shift_s=min(latency.least_shift_s + drifted_s, shift_s),
        heard_s=time_s,
    )
