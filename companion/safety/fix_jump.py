"""Fix jump: a step of the position because the GPS fix became better or worse, and not because the rover moved.

Nouns: fix jump.
"""

from __future__ import annotations

import math
from enum import Enum, auto

from companion.vehicle.events import GpsSeen, LocalPositionSeen
from companion.vehicle.gps_fix import GpsFix

WATCHED_S = 10.0
"""A step is looked for, and must be over, so long after the fix has changed."""
BEFORE_S = 2.0
"""The position may have begun to step before the message with the new fix came; what counts is where it was then."""
KNOWN_S = 3.0
"""A fix that is older than this is not compared with the next one."""
SEEN_M = 0.15
"""A step begins beyond this: less is the noise of position and velocity. What has begun is followed to its end."""
MEAN_S = 0.4
"""Places are means over so long: single reports are noisy."""
CALM_S, CALM_M = 1.0, 0.04
"""The step is over when the position has followed the velocity this well for so long."""
MARK_S = 0.1
GAP_S = 1.0
"""After a longer pause in the reports it is not known what became of the position."""


class JumpPhase(Enum):
    """How far a step has come."""

    NONE = auto()
    STEPPING = auto()
    SETTLED = auto()
    """For one report: the whole step is known."""
    LOST = auto()
    """For one report: the position still departs from its velocity after WATCHED_S."""


class FixJump:
    """Compares the position with the integral of the velocity from before a change of fix until after it.

    Only changes between fixes with a position (3D or better) count, as the receiver tells them one after the other.
    ``before`` and ``after``: the fixes. ``north_m``, ``east_m``: the step so far.
    """

    def __init__(self) -> None:
        self.phase = JumpPhase.NONE
        self.before = self.after = GpsFix.NO_GPS
        self._told: GpsSeen | None = None
        self._last: LocalPositionSeen | None = None
        self._sum_m = (0.0, 0.0)
        """Position minus integrated velocity, as of the last report."""
        self._marks: list[tuple[float, float, float]] = []
        """Time and ``_sum_m`` then, of the last BEFORE_S."""
        self._off_m = (0.0, 0.0)
        """The mean of the newest of them."""
        self._from_m: tuple[float, float] | None = None
        """``_off_m`` before the change; None while no step is looked for."""
        self._until_s = -math.inf

    @property
    def watching(self) -> bool:
        """Whether the fix has changed not long ago, so that a step would be one of the fix."""
        return self._from_m is not None

    @property
    def north_m(self) -> float:
        """The step so far, to the north."""
        return 0.0 if self._from_m is None else self._off_m[0] - self._from_m[0]

    @property
    def east_m(self) -> float:
        """The step so far, to the east."""
        return 0.0 if self._from_m is None else self._off_m[1] - self._from_m[1]

    @property
    def off_m(self) -> float:
        """Length of the step so far."""
        return math.hypot(self.north_m, self.east_m)

    def take_fix(self, event: GpsSeen) -> None:
        """One more fix."""
        if not event.fix.is_position:
            return
        told, self._told = self._told, event
        if told is None or event.time_s - told.time_s > KNOWN_S or event.fix == told.fix:
            return
        if self._from_m is None:
            self.before = told.fix
            self._from_m = self._mean_until(self._marks[0][0] + MEAN_S) if self._marks else self._off_m
        self.after = event.fix
        if self.phase is not JumpPhase.STEPPING:  # or a fix that changes again and again would let it step for ever
            self._until_s = event.time_s + WATCHED_S

    def take_report(self, now: LocalPositionSeen) -> None:
        """One more position."""
        last, self._last = self._last, now
        if last is None or not 0.0 < now.boot_s - last.boot_s < GAP_S:
            self.begin_anew()
            return
        elapsed_s = now.boot_s - last.boot_s
        north_m = now.north_m - last.north_m - (last.north_m_s + now.north_m_s) / 2.0 * elapsed_s
        east_m = now.east_m - last.east_m - (last.east_m_s + now.east_m_s) / 2.0 * elapsed_s
        self._sum_m = self._sum_m[0] + north_m, self._sum_m[1] + east_m
        if not self._marks or now.time_s - self._marks[-1][0] >= MARK_S - 1e-6:
            kept = [mark for mark in self._marks if now.time_s - mark[0] <= BEFORE_S]
            self._marks = [*kept, (now.time_s, *self._sum_m)]
        self._off_m = self._mean_until(math.inf, now.time_s - MEAN_S)
        self._look(now.time_s)

    def begin_anew(self) -> None:
        """Whatever has been the matter so far does not count any more."""
        self._sum_m = self._off_m = (0.0, 0.0)
        self._marks, self._from_m, self.phase = [], None, JumpPhase.NONE

    def _look(self, now_s: float) -> None:
        """The phase. After a step that is over the next one is looked for; after one that is lost it begins anew."""
        if self.phase is JumpPhase.SETTLED:
            self._from_m, self.before = self._off_m, self.after
        elif self.phase is JumpPhase.LOST:
            self.begin_anew()
            return
        steps = self._from_m is not None and (self.phase is JumpPhase.STEPPING or self.off_m > SEEN_M)
        self.phase = JumpPhase.NONE
        if steps:
            self.phase = JumpPhase.SETTLED if self._is_calm(now_s) else JumpPhase.STEPPING
            if self.phase is JumpPhase.STEPPING and now_s > self._until_s:
                self.phase = JumpPhase.LOST
        elif now_s > self._until_s:
            self._from_m = None

    def _is_calm(self, now_s: float) -> bool:
        """Whether the means of the last moments lie together."""
        if now_s - self._marks[0][0] < CALM_S - 2.0 * MARK_S:
            return False
        before = self._mean_until(now_s - CALM_S + MEAN_S, now_s - CALM_S)
        return math.dist(before, self._off_m) <= CALM_M

    def _mean_until(self, until_s: float, from_s: float = -math.inf) -> tuple[float, float]:
        """The mean of the marks of this time; of the newest if there is none."""
        chosen = [mark for mark in self._marks if from_s <= mark[0] <= until_s] or self._marks[-1:]
        return sum(mark[1] for mark in chosen) / len(chosen), sum(mark[2] for mark in chosen) / len(chosen)
