"""Whether somebody else steers this rover: the target that the autopilot says it follows, held against those we have sent."""

from __future__ import annotations

import math
from collections import deque

from companion.commands import Command, GuidedPosition
from companion.events.vehicle import HeartbeatSeen, RoverMode, TargetSeen
from companion.frames import GeoPoint, LocalFrame, NedPoint

TOLERANCE_M = 0.5
REMEMBERED = 200
RECENT_S = 10.0
TWICE = 2
"""One new target that is not ours may be a person's click at a ground station, or the place where GUIDED was entered."""
LISTEN_S = 3.0
"""Who finds a rover armed in GUIDED listens so long before he steers it: it may be somebody's."""


class Rivals:
    """Two companions on links of their own never hear each other's heartbeats; the autopilot tells its target to both.

    Counted are targets heard for the first time that we have not sent, but for the first one since GUIDED was set.
    """

    def __init__(self) -> None:
        self._known: deque[NedPoint] = deque(maxlen=REMEMBERED)
        self._times_s: deque[float] = deque(maxlen=TWICE)
        self._guided = self._began = False
        self._listen_until_s = math.nan

    def sent(self, command: Command) -> None:
        """A command of ours has gone out."""
        if isinstance(command, GuidedPosition):
            self._learn(command.point)

    def heard(self, event: HeartbeatSeen | TargetSeen, origin: GeoPoint | None) -> None:
        """A heartbeat or a target of the autopilot."""
        if isinstance(event, HeartbeatSeen):
            self._guided = event.mode == RoverMode.GUIDED
            if math.isnan(self._listen_until_s):
                self._listen_until_s = event.time_s + (LISTEN_S if self._guided and event.armed else 0.0)
            if not self._guided:
                self._times_s.clear()
                self._began = False
            return
        if origin is None:
            return
        new = self._learn(LocalFrame(origin).to_ned(event.point))
        if new and self._began:
            self._times_s.append(event.time_s)
        self._began = self._guided

    def steering(self, now_s: float) -> bool:
        """Whether somebody else has just sent targets, again and again."""
        return len(self._times_s) == TWICE and now_s - self._times_s[0] <= RECENT_S

    def awaited(self, now_s: float) -> str:
        """What must be waited for before we steer, in words; empty for nothing."""
        if self._times_s and now_s - self._times_s[-1] <= RECENT_S:
            return "another companion or ground station to leave the rover alone (its target changes)"
        return "signs of somebody else who drives it (it is armed in GUIDED)" if now_s < self._listen_until_s else ""

    def _learn(self, point: NedPoint) -> bool:
        """Whether it is a new one."""
        if any(point.distance_m(known) <= TOLERANCE_M for known in self._known):
            return False
        self._known.append(point)
        return True
