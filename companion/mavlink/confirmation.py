"""Confirmation by the autopilot: command acknowledgements, with repetition, and read-back of the position target."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.encode import command_number
from companion.vehicle.commands import Arm, ChangeSpeed, Command, GuidedHeading, GuidedPosition, GuidedVelocity, SetMode
from companion.vehicle.events import AckSeen, HeartbeatSeen, TargetSeen

TIMEOUT_S = 1.0
TRIES = 3
STALE_S = 5.0
"""A command that could not be repeated within this time is given up."""
NO_ANSWER = -1
"""Result of a command that was never answered (MAV_RESULT begins at 0)."""
IN_PROGRESS = 5
TOLERANCE_M = 0.5
LAG_S = 2.0
"""The read-back may lag by this much; after that the target counts as ignored."""
SILENT_S = 3.0
"""While there is a target it is reported at least once a second: no read-back means no target."""


@dataclass(frozen=True, slots=True)
class _Pending:
    command: Command
    sent_s: float
    tries: int
    heartbeat: HeartbeatSeen | None


class CommandTracker:
    """Repeats unanswered commands and keeps the answers; a newer command of a kind replaces the open one.

    A mode change or arming is repeated only if a heartbeat since then shows mode and arming unchanged: the command may
    have worked and its answer been lost, or a person may have set another mode. The pilot is never overruled.
    """

    def __init__(self) -> None:
        self._open: dict[int, _Pending] = {}
        self._results: dict[int, AckSeen] = {}
        self._heartbeat: HeartbeatSeen | None = None

    def last(self, command: Command) -> AckSeen | None:
        """The last answer to a command of this kind, or ``NO_ANSWER``; None while it is open."""
        number = command_number(command)
        return None if number is None else self._results.get(number)

    def sent(self, command: Command, now_s: float) -> None:
        """Call when a command has been sent."""
        number = command_number(command)
        if number is not None and isinstance(command, SetMode | Arm | ChangeSpeed):
            self._open[number] = _Pending(command, now_s, 1, self._heartbeat)

    def heard(self, event: AckSeen | HeartbeatSeen) -> None:
        """Call for each answer and heartbeat."""
        if isinstance(event, HeartbeatSeen):
            self._heartbeat = event
            self._open = {number: pending for number, pending in self._open.items() if not self._changed(pending)}
            return
        self._results[event.command] = event
        pending = self._open.get(event.command)
        if pending is not None and event.result == IN_PROGRESS:
            self._open[event.command] = replace(pending, sent_s=event.time_s)
        elif pending is not None:
            del self._open[event.command]

    def due(self, now_s: float) -> list[tuple[Command, int]]:
        """Commands to repeat now, each with its number of repetitions."""
        again: list[tuple[Command, int]] = []
        for number, pending in list(self._open.items()):
            if now_s - pending.sent_s > STALE_S:
                # Nothing was heard meanwhile: a person may have set another mode.
                del self._open[number]
                continue
            if now_s - pending.sent_s < TIMEOUT_S or not self._may_repeat(pending):
                continue
            if pending.tries >= TRIES:
                del self._open[number]
                self._results[number] = AckSeen(now_s, number, NO_ANSWER)
                continue
            self._open[number] = replace(pending, sent_s=now_s, tries=pending.tries + 1)
            again.append((pending.command, pending.tries))
        return again

    def _changed(self, pending: _Pending) -> bool:
        """Whether mode or arming have changed since the command was first sent."""
        before, now = pending.heartbeat, self._heartbeat
        if before is None or now is None:
            return False
        return (before.mode, before.armed) != (now.mode, now.armed)

    def _may_repeat(self, pending: _Pending) -> bool:
        if isinstance(pending.command, ChangeSpeed):
            return True
        return self._heartbeat is not None and self._heartbeat.time_s > pending.sent_s


class TargetReadBack:
    """Compares the autopilot's target with the one sent.

    ``confirmed``: None while unknown, False when the autopilot has ignored a target for 2 s or follows none."""

    def __init__(self) -> None:
        self.confirmed: bool | None = None
        self._sent: deque[tuple[float, NedPoint]] = deque()
        self._open_since_s: float | None = None
        self._heard_s = 0.0

    def sent(self, command: Command, now_s: float) -> None:
        """Call when a command has been sent; velocities and headings have no read-back."""
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
        """Call for each POSITION_TARGET_GLOBAL_INT: compares it with the recently sent targets."""
        if origin is None or not self._sent:
            return
        self._heard_s = event.time_s
        target = LocalFrame(origin).to_ned(event.point)
        # Of the older targets only the last is kept: it applies until the autopilot takes a newer one.
        while len(self._sent) > 1 and self._sent[1][0] < event.time_s - LAG_S:
            self._sent.popleft()
        if any(target.distance_m(point) <= TOLERANCE_M for _, point in self._sent):
            self.confirmed, self._open_since_s = True, None
        elif self._open_since_s is None:
            self._open_since_s = event.time_s

    def check(self, now_s: float) -> None:
        """Call every tick: a target that is not followed in time is not confirmed."""
        ignored = self._open_since_s is not None and now_s - self._open_since_s > LAG_S
        if ignored or (self._sent and now_s - self._heard_s > SILENT_S):
            self.confirmed = False
