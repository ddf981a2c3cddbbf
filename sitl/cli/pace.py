"""Limits the speed of simulated time to a multiple of real time."""

from __future__ import annotations

from companion.core.clock import Clock


class Pace:
    """``speedup`` None: as fast as possible. Time counts from the first call."""

    def __init__(self, speedup: float | None, clock: Clock) -> None:
        self._speedup = speedup
        self._clock = clock
        self._began: tuple[float, float] | None = None

    def wait(self, time_s: float) -> None:
        """Wait until the simulated ``time_s`` may be passed; return at once if it is late already."""
        if self._speedup is None:
            return
        began_s, first_s = self._began = self._began or (self._clock.now_s(), time_s)
        self._clock.sleep_until_s(began_s + (time_s - first_s) / self._speedup)
