"""Sends the mission's commands to the autopilot: one at a time, repeated until they are answered.

Each is announced in the saved state before it goes out: a run that is taken up knows which one may have been sent.
Nothing here waits: callers ask in every tick what to send.

Nouns: command sender.
"""

from __future__ import annotations

import math

from companion.core.severity import Severity, TextSink
from companion.executive.command_progress import (
    START,
    CommandProgress,
    CommandResult,
    OpenCommand,
    announced,
    begun,
    is_due,
    settled,
)
from companion.vehicle.commands import RunCommand
from companion.vehicle.events import AckSeen

TRIES = 3
TIMEOUT_S = 1.0
"""An answer that has not come by then, and the link's latency, does not come."""
ONCE_TIMEOUT_S = 3.0
"""A command that must not arrive twice is not repeated; its answer is awaited for this long."""
BUSY_S = 30.0
"""MAV_RESULT_IN_PROGRESS: the answer may take this long."""
LATE_S = 5.0
"""No answer comes later."""
SAVE_S = 1.0
"""A disk that does not answer keeps no command for longer."""
ACCEPTED, REJECTED_FOR_NOW, IN_PROGRESS = 0, 1, 5
RESULTS = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled"}
"""MAV_RESULT in words."""


def result_text(answer: int | None) -> str:
    """The autopilot's answer in words."""
    return "no answer" if answer is None else RESULTS.get(answer, f"result {answer}")


def _result_of(answer: int) -> CommandResult:
    return CommandResult.ACCEPTED if answer == ACCEPTED else CommandResult.REFUSED


class CommandSender:
    """``saved`` is told when the announcement of the present command is safe on the disk, or needs not be."""

    def __init__(self, notifier: TextSink) -> None:
        self._notifier = notifier
        self._tries = 0
        self._again_s = math.inf
        self._announced_s = self._sent_s = -math.inf
        self._saved = False
        self._rejected = False
        self._taken_up = False
        """Whether an earlier run may have sent the present command."""
        self._extra: dict[int, tuple[int, float]] = {}
        """By command: how many answers may still come to one that is done, and until when."""
        self._answers = 0
        self._doubtful: int | None = None
        """An answer that belongs to the present command, or to one like it before."""

    def resume(self, progress: CommandProgress, place: str) -> CommandProgress:
        """Take up the commands of an earlier run. One that may have been sent is sent again if that does no harm."""
        head = progress.head
        if head is None or not head.announced:
            return progress
        if head.command.repeatable:
            text = f"{head.command.name} at {place} may have been sent before: sent again"
            self._announced_s, self._taken_up = -math.inf, True
        else:
            text = f"{head.command.name} at {place} may have been sent before: not sent again, its result is not known"
            progress = settled(progress, CommandResult.UNANSWERED, None)
        self._notifier.tell(text, Severity.WARNING)
        return progress

    def awaits_save(self, progress: CommandProgress) -> bool:
        """Whether a command waits for its announcement to be saved."""
        return progress.head is not None and progress.head.announced and not self._saved and self._tries == 0

    def saved(self) -> None:
        """The announcement is on the disk."""
        self._saved = True

    def due(
        self,
        progress: CommandProgress,
        now_s: float,
        left_m: float,
        latency_s: float,
        place: str,
        *,
        away: bool = False,
    ) -> tuple[CommandProgress, RunCommand | None]:
        """What to send now, and how far the commands are. ``left_m``: to the next target; ``place``: of the head.

        ``away``: the rover is not at that place any more: nothing is sent for it, for the first time or again.
        """
        progress = begun(progress, now_s)
        head = progress.head
        if head is None or not (head.announced or is_due(head, now_s, left_m)):
            return progress, None
        if away:
            return self._left_behind(progress, now_s, place), None
        if not head.announced:
            self._reset()
            self._announced_s = now_s
            return announced(progress), None
        if self._tries == 0:
            if not self._saved and now_s - self._announced_s < SAVE_S:
                return progress, None
            return progress, self._send(head, now_s, latency_s)
        if now_s < self._again_s:
            return progress, None
        if self._tries < (TRIES if head.command.repeatable or self._rejected else 1):
            return progress, self._send(head, now_s, latency_s)
        return self._unanswered(progress, place), None

    def _left_behind(self, progress: CommandProgress, now_s: float, place: str) -> CommandProgress:
        """What becomes of the head away from its place; an answer that may still come is awaited."""
        if self._tries == 0:
            result = CommandResult.UNANSWERED if self._taken_up else CommandResult.LEFT_OUT
            return self._end(progress, result, None, place)
        if now_s < self._again_s:
            return progress
        if self._rejected:
            return self._end(progress, CommandResult.REFUSED, REJECTED_FOR_NOW, place)
        return self._unanswered(progress, place)

    def _unanswered(self, progress: CommandProgress, place: str) -> CommandProgress:
        """No answer is surely the head's. A doubtful one decides: answers come in order, so no older one comes now."""
        if self._doubtful is None:
            return self._end(progress, CommandResult.UNANSWERED, None, place)
        self._answers = self._tries
        return self._end(progress, _result_of(self._doubtful), self._doubtful, place)

    def answered(self, progress: CommandProgress, ack: AckSeen, place: str) -> CommandProgress:
        """An answer of the autopilot. ``place``: of the head, in words."""
        head = progress.head
        is_extra = self._is_extra(ack)
        if head is None or self._tries == 0 or ack.command != head.command.command:
            return progress
        if is_extra:
            self._doubtful = ack.result if ack.result != IN_PROGRESS else self._doubtful
            return progress
        if ack.result == IN_PROGRESS:
            self._again_s = ack.time_s + BUSY_S
            return progress
        self._answers += 1
        self._doubtful = None
        if ack.result == REJECTED_FOR_NOW and self._tries < TRIES:
            self._again_s, self._rejected = ack.time_s + TIMEOUT_S, True
            return progress
        return self._end(progress, _result_of(ack.result), ack.result, place)

    def _is_extra(self, ack: AckSeen) -> bool:
        """Whether it may answer a command that is done."""
        count, until_s = self._extra.pop(ack.command, (0, -math.inf))
        if count > 1 and ack.time_s <= until_s:
            self._extra[ack.command] = (count - 1, until_s)
        return count > 0 and ack.time_s <= until_s

    def _send(self, head: OpenCommand, now_s: float, latency_s: float) -> RunCommand:
        command = head.command
        wait_s = TIMEOUT_S if command.repeatable else ONCE_TIMEOUT_S
        self._again_s = now_s + wait_s + 2.0 * latency_s
        self._tries += 1
        self._rejected = False
        self._sent_s = now_s
        place = None if command.place is None else (command.place.lat_deg, command.place.lon_deg)
        return RunCommand(command.command, command.params, place, command.frame, self._tries - 1)

    def _end(self, progress: CommandProgress, result: CommandResult, answer: int | None, place: str) -> CommandProgress:
        head = progress.open[0]
        doubt = ", or the one before it was" if self._doubtful is not None and answer is not None else ""
        if result is CommandResult.ACCEPTED:
            self._notifier.tell(f"{head.command.name} at {place}: accepted{doubt}", Severity.INFO)
        elif result is CommandResult.LEFT_OUT:
            self._notifier.tell(
                f"Not sent, the rover is not at {place} any more: {head.command.name}", Severity.WARNING
            )
        else:
            again = f" after {self._tries} tries" if self._tries > 1 else ""
            text = f"{head.command.name} at {place}: {result} ({result_text(answer)}){again}{doubt}"
            self._notifier.tell(text if answer is not None else text.replace(" (no answer)", ""), Severity.WARNING)
        before, until_s = self._extra.get(head.command.command, (0, -math.inf))
        late = self._tries - self._answers + (before if until_s >= self._sent_s else 0)
        if self._tries > 0:
            self._extra[head.command.command] = (late, self._sent_s + LATE_S)
        self._reset()
        return settled(progress, result, answer)

    def _reset(self) -> None:
        self._tries, self._saved, self._rejected = 0, False, False
        self._taken_up, self._answers, self._doubtful = False, 0, None
        self._again_s = math.inf


def place_name(head: OpenCommand | None, targets: tuple[str, ...]) -> str:
    """Where a command belongs, in words."""
    return "" if head is None else "the start" if head.place == START else targets[head.place]
