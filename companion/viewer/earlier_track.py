"""The earlier track: where the rover has been, for as long as it has driven, as few enough places to send at once.

Nouns: earlier track.
"""

from __future__ import annotations

import math
from typing import Any

MOST = 6000
"""A browser that comes is told all of them: about 200 kB. Of more, every second one goes."""
GAP_S, JUMP_M = 5.0, 5.0
"""After so long without a place, or so far beyond what its speed explains, the track begins anew."""


class EarlierTrack:
    """Takes frames of one run, in the order of time."""

    def __init__(self) -> None:
        self._places: list[list[float]] = []
        self._every = self._skipped = 1
        self._newest: list[float] | None = None
        self._starts = True

    def add(self, frame: dict[str, Any]) -> None:
        """One more; the frames between are left out once there have been many."""
        t, pose, speed_m_s = frame["t"], frame["pose"], abs(frame["speed"] or 0.0)
        if pose is None:
            self._starts = True
            return
        if self._newest is not None:
            since_s, far_m = t - self._newest[0], math.dist(self._newest[1:3], pose[:2])
            self._starts |= since_s > GAP_S or far_m > max(JUMP_M, (2.0 * speed_m_s + JUMP_M) * since_s)
        self._newest = [t, *pose[:2], speed_m_s, int(self._starts)]
        self._skipped += 1
        if self._skipped >= self._every:
            self._skipped, self._starts = 0, False
            self._places.append(self._newest)
            if len(self._places) > MOST:
                self._thin()

    def extend(self, places: list[list[float]]) -> None:
        """Further ``places`` of another one, which knew more."""
        for place in places:
            self._places.append(place)
            if len(self._places) > MOST:
                self._thin()
        if places:
            self._newest, self._starts = places[-1], False

    def _thin(self) -> None:
        """Every second place goes. Where it began a line, the next one does."""
        self._every *= 2
        for gone, stays in zip(self._places[1::2], self._places[2::2], strict=False):
            stays[4] = gone[4] or stays[4]
        self._places = self._places[::2]

    @property
    def places(self) -> list[list[float]]:
        """Seconds, north and east in metres, speed in m/s, and 1 where a new line begins, else 0.

        The newest is always among them: what comes after it joins on.
        """
        rest = [] if self._newest is None or self._newest[0] == self._places[-1][0] else [self._newest]
        return [*self._places, *rest]
