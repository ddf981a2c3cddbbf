"""A lidar's own clock: how late its bytes come, compared with the best moment of the run.

So a line that is late for good is noticed; what varies on the way of messages is ``ArrivalJitter``.

Nouns: device clock.
"""

from __future__ import annotations

WRAP_MS = 30_000
"""The LD06 and LD19 count from 0 to this."""
DRIFT = 1e-3
"""Growth no faster than this share of the time is no delay, but two clocks that drift apart."""
MOST_S = 10.0
"""A longer delay cannot be told from a clock that began anew."""


class DeviceClock:
    """Of one lidar, since its line was opened."""

    def __init__(self) -> None:
        self._told_ms: int | None = None
        self._heard_s = 0.0
        self._offset_s = 0.0
        self._least_s = 0.0

    def late_s(self, told_ms: int | None, time_s: float) -> float:
        """How late bytes came that bear this time and came at ``time_s``; 0 for a lidar that tells no time."""
        before_ms, self._told_ms = self._told_ms, told_ms
        if told_ms is None or before_ms is None:
            self._heard_s = time_s
            return 0.0
        if told_ms == before_ms:
            return max(self._offset_s - self._least_s, 0.0)  # nothing new, or a clock that stands
        heard_s, self._heard_s = self._heard_s, time_s
        self._offset_s += time_s - heard_s - (told_ms - before_ms) % WRAP_MS / 1000.0
        self._least_s = min(self._least_s + DRIFT * (time_s - heard_s), self._offset_s)
        if self._offset_s - self._least_s > MOST_S:
            self._offset_s = self._least_s = 0.0
        return self._offset_s - self._least_s
