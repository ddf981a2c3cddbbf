"""Turns: points joined into whole turns of a lidar, each cut just behind straight ahead.

So the newest readings of every scan are those ahead, where the rover drives, and the oldest those behind them. Quarters
of a turn would tell of the ground ahead no sooner, and of the rest in pieces that repeated, partly unseen or moving
things cannot be told from.

Nouns: turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.lidar.points import Floats, Points, joined

SECTORS = 72
LEAST_SECTORS = 54
"""A turn with points in fewer of the 72 sectors of 5 degrees has lost too much to be a view."""
MOST_POINTS = 4000
"""A turn with more points is none: the motor stands, or turns too slowly to be believed."""
LEAST_TURN_S, MOST_TURN_S = 0.04, 0.5


@dataclass(frozen=True, eq=False, slots=True)
class Turn:
    """One turn. ``time_s``: when its last point was taken; ``age_s``, shape (n,): how long before that each was."""

    time_s: float
    age_s: Floats
    points: Points


class TurnJoiner:
    """Joins the points of one lidar. ``cut_deg``: the angle of the sensor at which a turn ends."""

    def __init__(self, cut_deg: float, usual_s: float) -> None:
        """``usual_s``: how long a turn takes until that is known."""
        self._cut_deg = cut_deg
        self._turn_s = usual_s
        self._ended_s: float | None = None
        self._parts: list[Points] = []
        self._count = 0
        self._last_deg: float | None = None
        self.incomplete = 0
        """Turns of which too much was missing."""

    def feed(self, points: Points, time_s: float) -> list[Turn]:
        """The turns completed by these points, the last of which was taken at ``time_s``."""
        if not len(points):
            return []
        # Degrees since the cut: where they fall back, a new turn begins.
        since_deg = (points.angle_deg - self._cut_deg) % 360.0
        before_deg = np.concatenate(([since_deg[0] if self._last_deg is None else self._last_deg], since_deg[:-1]))
        begins = np.flatnonzero(before_deg - since_deg > 180.0)
        self._last_deg = float(since_deg[-1])
        swept_deg = np.cumsum((since_deg - before_deg + 180.0) % 360.0 - 180.0)
        turns: list[Turn] = []
        at = 0
        for begin in begins.tolist():
            self._add(_part(points, at, begin))
            further_deg = float(swept_deg[-1] - swept_deg[begin] + since_deg[begin])  # since the cut
            turns += self._ended(time_s - further_deg / 360.0 * self._turn_s)
            at = begin
        self._add(_part(points, at, len(points)))
        return turns

    def forget(self) -> None:
        """The line was cut: what was heard of the present turn does not belong to what comes."""
        self._parts, self._count, self._last_deg, self._ended_s = [], 0, None, None

    def _add(self, part: Points) -> None:
        if len(part):
            self._parts.append(part)
            self._count += len(part)
        if self._count > MOST_POINTS:
            self.forget()

    def _ended(self, time_s: float) -> list[Turn]:
        ended_s = self._ended_s
        took_s = np.inf if ended_s is None else time_s - ended_s
        if took_s < LEAST_TURN_S:
            return []  # angles waver: this is the cut that ended the turn before
        points = joined(self._parts)
        self._parts, self._count, self._ended_s = [], 0, time_s
        if ended_s is None:
            return []  # the first is heard from its middle on
        if took_s <= MOST_TURN_S:
            self._turn_s += 0.3 * (took_s - self._turn_s)
        since_deg = (points.angle_deg - self._cut_deg) % 360.0
        whole = len(np.unique((since_deg // (360.0 / SECTORS)).astype(np.int64))) >= LEAST_SECTORS
        if not whole or took_s > MOST_TURN_S:
            self.incomplete += 1
            return []
        return [Turn(time_s, (360.0 - since_deg) / 360.0 * self._turn_s, points)]


def _part(points: Points, begin: int, end: int) -> Points:
    return Points(points.angle_deg[begin:end], points.range_m[begin:end], points.quality[begin:end])
