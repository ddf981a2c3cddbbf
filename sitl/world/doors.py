"""Doors: obstacles that open and close by a timetable.

Times are the simulator's, in seconds since it was created. They are kept as integer milliseconds, so that rounding
cannot decide whether a door is open.

Nouns: Door.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NEVER_S = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Door:
    """Obstacle fields that exist only while the door is closed.

    ``fields``: shape (height, width), the fields of the world that it closes. ``open_ms``: half-open spans [begin,
    end) during which it is open; ``period_ms``: after this time the timetable starts over, 0: never.
    """

    name: str
    fields: NDArray[np.bool_]
    open_ms: tuple[tuple[int, int], ...]
    period_ms: int = 0

    def is_open(self, time_s: float) -> bool:
        """Whether it is open at a moment."""
        now_ms = self._within_period(whole_ms(time_s))
        return any(begin <= now_ms < end for begin, end in self.open_ms)

    def next_change_s(self, time_s: float) -> float:
        """The next time after ``time_s`` at which it opens or closes; infinity if never."""
        time_ms = whole_ms(time_s)
        now_ms = self._within_period(time_ms)
        moments = sorted({moment for span in self.open_ms for moment in span if moment != FOR_EVER_MS})
        if self.period_ms:
            moments += [moment + self.period_ms for moment in moments]
        later = [moment for moment in moments if moment > now_ms]
        return (time_ms - now_ms + later[0]) / 1000.0 if later else NEVER_S

    def _within_period(self, time_ms: int) -> int:
        return time_ms % self.period_ms if self.period_ms else time_ms


FOR_EVER_MS = 10**15
"""End of a span without an end."""


def whole_ms(time_s: float) -> int:
    """The millisecond of a moment; a moment less than a microsecond before the next one belongs to that."""
    return math.floor(time_s * 1000.0 + 1e-3)


def next_change_s(doors: tuple[Door, ...], time_s: float) -> float:
    """The next time after ``time_s`` at which any door opens or closes; infinity if never."""
    return min((door.next_change_s(time_s) for door in doors), default=NEVER_S)
