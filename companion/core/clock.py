"""The only place that reads time. Everything else is handed a clock, or the time itself.

Nouns: clock.
"""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What the companion needs of time."""

    def now_s(self) -> float:
        """Seconds since an arbitrary moment; never goes back."""
        ...

    def sleep_until_s(self, time_s: float) -> None:
        """Return when ``now_s() >= time_s``. In lock-step, this call moves the world."""
        ...


class WallClock:
    """Real time, from the system's monotonic clock."""

    def now_s(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def sleep_until_s(self, time_s: float) -> None:
        """Sleep; returns at once when the moment has passed."""
        time.sleep(max(0.0, time_s - time.monotonic()))


def stopwatch_s() -> float:
    """Seconds of the finest clock there is, for measuring how long a computation took (never for decisions)."""
    return time.perf_counter()


def processor_s() -> float:
    """Seconds of the processor that this process has used (never for decisions)."""
    return time.process_time()


def unix_time_us() -> int:
    """Microseconds since 1970, for records that people read (never for decisions)."""
    return time.time_ns() // 1000
