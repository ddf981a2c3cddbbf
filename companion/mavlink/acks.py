"""Commands that are answered: repeated while no answer comes, and the answers kept."""

from __future__ import annotations

from dataclasses import dataclass, replace

from companion.mavlink.encode import command_number
from companion.vehicle.commands import Arm, ChangeSpeed, Command, SetMode
from companion.vehicle.events.vehicle import AckSeen, HeartbeatSeen

TIMEOUT_S = 1.0
TRIES = 3
STALE_S = 5.0
"""A command that could not be repeated for so long is not repeated at all."""
NO_ANSWER = -1
"""Result of a command that was never answered (MAV_RESULT itself begins at 0)."""
IN_PROGRESS = 5


@dataclass(frozen=True, slots=True)
class _Pending:
    command: Command
    sent_s: float
    tries: int
    heartbeat: HeartbeatSeen | None


class AckKeeper:
    """One open command of each kind; a newer one takes its place.

    A mode change or arming is repeated only if a heartbeat since then shows mode and arming as they were: the command may have
    worked and its answer been lost, and a person may have chosen otherwise meanwhile. The pilot is never overruled.
    """

    def __init__(self) -> None:
        self._open: dict[int, _Pending] = {}
        self._results: dict[int, AckSeen] = {}
        self._heartbeat: HeartbeatSeen | None = None

    def last(self, command: Command) -> AckSeen | None:
        """The last answer to a command of this kind, ``NO_ANSWER`` included; None while there is none."""
        number = command_number(command)
        return None if number is None else self._results.get(number)

    def sent(self, command: Command, now_s: float) -> None:
        """A command has gone out."""
        number = command_number(command)
        if number is not None and isinstance(command, SetMode | Arm | ChangeSpeed):
            self._open[number] = _Pending(command, now_s, 1, self._heartbeat)

    def heard(self, event: AckSeen | HeartbeatSeen) -> None:
        """An answer or a heartbeat has come in."""
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
        """Commands to repeat now, each with its count of repetitions."""
        again: list[tuple[Command, int]] = []
        for number, pending in list(self._open.items()):
            if now_s - pending.sent_s > STALE_S:
                # Nobody was heard meanwhile: whatever a person has chosen since then is not known.
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
        """Whether mode or arming are no longer as when the command was first sent."""
        before, now = pending.heartbeat, self._heartbeat
        if before is None or now is None:
            return False
        return (before.mode, before.armed) != (now.mode, now.armed)

    def _may_repeat(self, pending: _Pending) -> bool:
        if isinstance(pending.command, ChangeSpeed):
            return True
        return self._heartbeat is not None and self._heartbeat.time_s > pending.sent_s
