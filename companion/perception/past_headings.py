"""Past headings: how far the rover has turned in the last second.

Nouns: past headings.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.vehicle.events import AttitudeSeen

Floats = NDArray[np.float64]

KEPT_S = 1.0
ANEW_S = 0.5
"""More than what waits on the way can be out of order."""


class PastHeadings:
    """Of each attitude, as a number that does not jump where a circle begins anew."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float]] = deque()
        self._rate_rad_s = 0.0
        self._noted: AttitudeSeen | None = None

    def note(self, attitude: AttitudeSeen, came_s: float) -> None:
        """The last attitude, and when it came without the jitter of its way; the same one again is no matter.

        One that is not later than the last is left out; one that is earlier by far begins anew.
        """
        if attitude is self._noted:
            return
        self._noted = attitude
        if self._past and came_s < self._past[-1][0] - ANEW_S:
            self._past.clear()
        if self._past and came_s <= self._past[-1][0]:
            return
        before_rad = self._past[-1][1] if self._past else attitude.heading_rad
        turned_rad = math.remainder(attitude.heading_rad - before_rad, 2.0 * math.pi)
        self._past.append((came_s, before_rad + turned_rad))
        self._rate_rad_s = attitude.yaw_rate_rad_s
        while self._past[-1][0] - self._past[0][0] > KEPT_S:
            self._past.popleft()

    def known_s(self, time_s: float) -> float:
        """Since how long before ``time_s`` headings are known."""
        return time_s - self._past[0][0] if self._past else 0.0

    def turned_rad(self, time_s: float, ages_s: Floats) -> Floats:
        """How far the rover has turned, clockwise, from so long before ``time_s`` on until then.

        After the last attitude it has turned on evenly; before the first one it had not turned.
        """
        if not self._past:
            return np.zeros(len(ages_s))
        times_s, headings_rad = np.array(self._past).T
        then_s = time_s - ages_s
        later_rad = self._rate_rad_s * np.maximum(np.append(then_s, time_s) - times_s[-1], 0.0)
        seen_rad = np.interp(np.append(then_s, time_s), times_s, headings_rad) + later_rad
        turned: Floats = seen_rad[-1] - seen_rad[:-1]
        return turned
