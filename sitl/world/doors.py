"""The truth that opens and closes: doors with a timetable.

Times are the simulator's, in seconds since it was made, and are kept as whole milliseconds, so that no rounding decides on which
side of a moment a door is open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NEVER_S = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Door:
    """Obstacle fields that are there only while it is closed.

    ``fields``: shape (height, width), which fields of the world it closes. ``open_ms``: spans during which it is open, the first
    millisecond belongs to the span and the last does not; ``period_ms``: after so long the timetable begins anew, 0: never.
    """

    name: str
    fields: NDArray[np.bool_]
    open_ms: tuple[tuple[int, int], ...]
    period_ms: int = 0

    def is_open(self, time_s: float) -> bool:
        """Whether one can pass at this moment."""
        now_ms = self._within_period(whole_ms(time_s))
        return any(begin <= now_ms < end for begin, end in self.open_ms)

    def next_change_s(self, time_s: float) -> float:
        """The first moment after this one at which it opens or closes; infinity when that never comes."""
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
"""End of a span that does not end."""


def whole_ms(time_s: float) -> int:
    """The millisecond in which a moment lies; what is less than a microsecond before the next one counts as that."""
    return math.floor(time_s * 1000.0 + 1e-3)


def next_change_s(doors: tuple[Door, ...], time_s: float) -> float:
    """The first moment after this one at which any of the doors moves; infinity if none ever does."""
    return min((door.next_change_s(time_s) for door in doors), default=NEVER_S)
