"""Compares the target that the autopilot follows with the one it was given."""

from __future__ import annotations

from collections import deque

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.vehicle.commands import Command, GuidedHeading, GuidedPosition, GuidedVelocity
from companion.vehicle.events.vehicle import TargetSeen

TOLERANCE_M = 0.5
LAG_S = 2.0
"""The read-back may lag so far behind, and must have come by then."""
SILENT_S = 3.0
"""It comes once a second at least while there is a target: no read-back means no target."""


class ReadBack:
    """``confirmed`` is None while nothing can be said, False when the autopilot has not taken a target for 2 s, or follows none."""

    def __init__(self) -> None:
        self.confirmed: bool | None = None
        self._sent: deque[tuple[float, NedPoint]] = deque()
        self._open_since_s: float | None = None
        self._heard_s = 0.0

    def sent(self, command: Command, now_s: float) -> None:
        """A command has gone out; velocities and headings have no read-back."""
        if isinstance(command, GuidedVelocity | GuidedHeading):
            self._sent.clear()
            self._open_since_s = self.confirmed = None
        if not isinstance(command, GuidedPosition):
            return
        if not self._sent or self._sent[-1][1].distance_m(command.point) > TOLERANCE_M:
            self._open_since_s = now_s if self._open_since_s is None else self._open_since_s
        if not self._sent:
            self._heard_s = now_s
        self._sent.append((now_s, command.point))

    def heard(self, event: TargetSeen, origin: GeoPoint | None) -> None:
        """POSITION_TARGET_GLOBAL_INT has come: does it agree with a target of the last moments?"""
        if origin is None or not self._sent:
            return
        self._heard_s = event.time_s
        target = LocalFrame(origin).to_ned(event.point)
        # Of the older targets only the last is kept: it is in force until a newer one is taken.
        while len(self._sent) > 1 and self._sent[1][0] < event.time_s - LAG_S:
            self._sent.popleft()
        if any(target.distance_m(point) <= TOLERANCE_M for _, point in self._sent):
            self.confirmed, self._open_since_s = True, None
        elif self._open_since_s is None:
            self._open_since_s = event.time_s

    def check(self, now_s: float) -> None:
        """Time passes: a target that is not followed in time is not confirmed."""
        ignored = self._open_since_s is not None and now_s - self._open_since_s > LAG_S
        if ignored or (self._sent and now_s - self._heard_s > SILENT_S):
            self.confirmed = False
