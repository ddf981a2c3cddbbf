"""Log lines of collisions: each one is told, those of a scraping rover once a second together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from sitl.world.truth import Collision, SimStart

COLLISIONS_EVERY_S = 1.0
"""Minimum time between groups of lines: a rover that scrapes along a wall touches it many times."""


class CollisionLog:
    """Tells contacts that are new; ``now_s`` reads real seconds."""

    def __init__(self, tell: Callable[[str], None], now_s: Callable[[], float]) -> None:
        self._tell = tell
        self._now_s = now_s
        self._told = 0
        self._told_s = -math.inf

    def look(self, collisions: Sequence[Collision], start: SimStart, *, last: bool = False) -> None:
        """Tell those since the last look; ``last``: nobody looks again."""
        if len(collisions) == self._told or not (last or self._now_s() - self._told_s >= COLLISIONS_EVERY_S):
            return
        for number in range(self._told, len(collisions)):
            self._tell(f"collision {number + 1}: {collisions[number].told(start)}")
        self._told, self._told_s = len(collisions), self._now_s()

    def forget(self) -> None:
        """Collisions are counted from 1 again."""
        self._told = 0
