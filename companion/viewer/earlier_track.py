"""The earlier track: where the rover has been, for as long as it has driven, as few enough places to send at once.

Nouns: earlier track.
"""

from __future__ import annotations

from typing import Any

MOST = 6000
"""A browser that comes is told all of them: about 200 kB. Of more, every second one goes."""


class EarlierTrack:
    """Takes frames in the order of time; one that is earlier than the last begins another track."""

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._places: list[list[float]] = []
        self._every = self._skipped = 1
        self._newest: list[float] | None = None

    def add(self, frame: dict[str, Any]) -> None:
        """One more; the frames between are left out once there have been many."""
        if self._newest is not None and frame["t"] < self._newest[0]:
            self._begin()
        pose, speed = frame["pose"], frame["speed"]
        self._newest = [frame["t"]] if pose is None else [frame["t"], pose[0], pose[1], speed or 0.0]
        self._skipped += 1
        if self._skipped < self._every:
            return
        self._skipped = 0
        self._places.append(self._newest)
        if len(self._places) > MOST:
            self._every *= 2
            self._places = self._places[::2]

    @property
    def places(self) -> list[list[float]]:
        """Seconds, north and east in metres, speed in m/s; seconds alone where the track has a gap.

        The newest is always among them: what comes after it joins on.
        """
        rest = [] if self._newest is None or self._newest is self._places[-1] else [self._newest]
        return [*self._places, *rest]
