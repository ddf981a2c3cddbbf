"""Laps of a patrol: the way driven, and a summary of each lap.

Nouns: lap, odometer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from companion.core.frames import NedPoint

COUNTED_M = 0.2
"""The way is counted in pieces of at least this length: a position that wanders drives nowhere."""
JUMP_M = 5.0
"""A longer piece is no way that was driven but another position."""


class Odometer:
    """Metres driven, by the position that the autopilot tells."""

    def __init__(self) -> None:
        self.driven_m = 0.0
        self._last: NedPoint | None = None

    def at(self, point: NedPoint) -> None:
        """The rover is here now."""
        if self._last is None:
            self._last = point
            return
        moved_m = self._last.distance_m(point)
        if moved_m < COUNTED_M:
            return
        self.driven_m += moved_m if moved_m <= JUMP_M else 0.0
        self._last = point

    def forget_place(self) -> None:
        """Places are counted from elsewhere now."""
        self._last = None


@dataclass(frozen=True, slots=True)
class LapStart:
    """When a lap began, by the companion's clock and the odometer, and how many commands had failed before."""

    time_s: float
    driven_m: float = 0.0
    failed: int = 0


@dataclass(frozen=True, slots=True)
class LapSummary:
    """One lap of a patrol. ``missed``: names of targets; ``failed``: commands refused or not answered."""

    number: int
    seconds: float
    driven_m: float
    missed: tuple[str, ...]
    failed: int

    def __str__(self) -> str:
        """For people."""
        missed = f"missed {', '.join(self.missed)}" if self.missed else "no target missed"
        failed = f", {self.failed} command{'s' * (self.failed != 1)} refused or unanswered" if self.failed else ""
        return f"Lap {self.number}: {self.seconds:.0f} s, {self.driven_m:.0f} m, {missed}{failed}"


def lap_summary(
    number: int, start: LapStart, time_s: float, driven_m: float, missed: Iterable[str], failed: int
) -> LapSummary:
    """The lap that ends now."""
    return LapSummary(number, time_s - start.time_s, driven_m - start.driven_m, tuple(missed), failed - start.failed)
