"""Latency of the link, by the autopilot's answers to TIMESYNC and by its boot time compared with the companion's clock.

ArduPilot answers a TIMESYNC with the sender's time and its own: the round trip is the time between an observation and
the arrival of a stop. The boot time in every position report shows a delay on the way to the companion before the next
answer does.

Nouns: latency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

KEPT = 3
"""Answers and reports considered together: one late packet does not make a late link, but the speed allows for it."""
AHEAD_S = 1.0
"""A boot time has jumped if it gains more than this on the companion's clock,"""
BACK_S = 5.0
"""or runs back by more than this: more than packets overtake each other."""
DRIFT = 1e-4
"""Relative drift of two quartz clocks: growth no faster than this is no delay, even if TIMESYNC is never answered."""


@dataclass(frozen=True, slots=True)
class TimeAnswered:
    """The autopilot's answer to a TIMESYNC of the companion.

    ``asked_ns``: when it was sent, by the companion's clock.
    """

    time_s: float
    asked_ns: int


@dataclass(frozen=True, slots=True)
class Latency:
    """The measurements; latencies are 0 until there are any."""

    round_trips_s: tuple[float, ...] = ()
    """Of the newest answers, at most KEPT."""
    shifts_s: tuple[float, ...] = ()
    """The companion's clock minus the autopilot's, in the newest position reports, at most KEPT."""
    least_shift_s: float = math.inf
    """The same without delay: the smallest so far, or as an answer has shown; it may rise as clocks drift."""
    heard_s: float = math.inf
    """When the newest position report arrived."""
    jumped_s: float = -math.inf
    """When the autopilot's clock last jumped."""

    @property
    def longest_s(self) -> float:
        """For choosing the speed: the longest of the newest round trips; the delay to the companion if that is more."""
        return max(self.round_trip_s, self.growth_s)

    @property
    def round_trip_s(self) -> float:
        """The longest of the newest round trips."""
        return max(self.round_trips_s, default=0.0)

    @property
    def lasting_s(self) -> float:
        """The lasting part: the shortest of the newest round trips; the delay to the companion if that is more."""
        whole = len(self.round_trips_s) == KEPT
        return max(min(self.round_trips_s) if whole else 0.0, self.growth_s)

    @property
    def growth_s(self) -> float:
        """How much later position reports arrive now than at best."""
        return min(self.shifts_s) - self.least_shift_s if len(self.shifts_s) == KEPT else 0.0


def latency_after_answer(latency: Latency, event: TimeAnswered) -> Latency:
    """The latency after an answer. A delay to the companion above the whole round trip is drift of the clocks."""
    round_trip_s = max(0.0, event.time_s - event.asked_ns / 1e9)
    least_s = latency.least_shift_s
    if latency.shifts_s:
        least_s = max(least_s, min(latency.shifts_s) - round_trip_s)
    return replace(latency, round_trips_s=(*latency.round_trips_s[1 - KEPT :], round_trip_s), least_shift_s=least_s)


def latency_after_report(latency: Latency, time_s: float, boot_s: float) -> Latency:
    """The latency after a position report made at boot time ``boot_s``, received at ``time_s``."""
    shift_s = time_s - boot_s
    if latency.shifts_s and shift_s < latency.least_shift_s - AHEAD_S:
        return Latency(latency.round_trips_s, (shift_s,), shift_s, time_s, time_s)
    drifted_s = DRIFT * max(0.0, time_s - latency.heard_s)
    shifts_s = (*latency.shifts_s[1 - KEPT :], shift_s)
    least_s = min(latency.least_shift_s + drifted_s, shift_s)
    return Latency(latency.round_trips_s, shifts_s, least_s, time_s, latency.jumped_s)
