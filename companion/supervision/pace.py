"""The pace of the loop: sleeps until the next tick begins, and measures how late and how long it is.

Nouns: pace.
"""

from __future__ import annotations

from companion.core.clock import Clock, stopwatch_s
from companion.safety.watchdogs import STALL_S
from companion.settings.live_settings import LiveSettings


class Pace:
    """Sleeps until the next tick begins; in lock-step this moves the world."""

    def __init__(self, clock: Clock, settings: LiveSettings) -> None:
        self.late_s = 0.0
        """How late this tick is."""
        self._clock = clock
        self._settings = settings
        self._next_tick_s = clock.now_s()
        self._began_s = stopwatch_s()

    @property
    def elapsed_s(self) -> float:
        """How long this tick has taken so far, by the computer's own stopwatch."""
        return stopwatch_s() - self._began_s

    def sleep(self) -> float:
        """Returns the time."""
        self._next_tick_s += 1.0 / self._settings.current.link.tick_hz
        self._clock.sleep_until_s(self._next_tick_s)
        now_s = self._clock.now_s()
        self.late_s = now_s - self._next_tick_s
        if self.late_s > STALL_S:
            # After a stall (a suspended computer) do not catch up tick by tick.
            self._next_tick_s = now_s
        self._began_s = stopwatch_s()
        return now_s
