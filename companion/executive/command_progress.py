"""Commands of the mission for the autopilot: which are due, which may have been sent, and what became of each. Pure.

Nouns: command progress, command result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from companion.core.frames import NedPoint
from companion.mission.do_commands import DoCommand

START = -1
"""The place of the commands that are sent where the mission begins; others have the number of their target."""


class CommandResult(StrEnum):
    """What became of a command."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    UNANSWERED = "unanswered"
    """Whether it was done is not known."""
    LEFT_OUT = "left out"
    """Its place was not reached, or the rover left before it was due. It was never sent."""


@dataclass(frozen=True, slots=True)
class OpenCommand:
    """A command that is to be sent. ``place`` and ``number`` tell which one it is.

    ``due_s``: not before then; None while others come before a condition of time. ``on_way``: the rover goes on
    meanwhile. ``announced``: it may have been sent, for all that a later run can know. ``at``: where the rover arrived,
    in the local frame; None for what is sent on the way.
    """

    place: int
    number: int
    command: DoCommand
    due_s: float | None
    on_way: bool = False
    announced: bool = False
    at: NedPoint | None = None

    def is_left_by(self, rover: NedPoint, near_m: float) -> bool:
        """Whether the rover is farther than ``near_m`` from where it arrived for this command."""
        return self.at is not None and rover.distance_m(self.at) > near_m


@dataclass(frozen=True, slots=True)
class CommandTally:
    """How often a command had which result, and the autopilot's last MAV_RESULT (None: it never answered)."""

    place: int
    number: int
    counts: tuple[tuple[CommandResult, int], ...] = ()
    answer: int | None = None

    def count(self, result: CommandResult) -> int:
        """How often it had this result."""
        return dict(self.counts).get(result, 0)


@dataclass(frozen=True, slots=True)
class CommandProgress:
    """``open``: in their order, one at a time. ``tallies``: of every command that was due so far."""

    open: tuple[OpenCommand, ...] = ()
    tallies: tuple[CommandTally, ...] = ()

    @property
    def keeps_here(self) -> bool:
        """Whether the rover stays where it is until a command is done."""
        return bool(self.open) and not self.open[0].on_way

    @property
    def head(self) -> OpenCommand | None:
        """The command whose turn it is."""
        return self.open[0] if self.open else None

    def total(self, *results: CommandResult) -> int:
        """How many commands had one of these results, every time counted."""
        return sum(tally.count(result) for tally in self.tallies for result in results)


NO_COMMANDS = CommandProgress()


def arrived(
    progress: CommandProgress, place: int, commands: tuple[DoCommand, ...], now_s: float, at: NedPoint | None = None
) -> CommandProgress:
    """The commands of a place that was reached. What still waited for its time on the way here is left out.

    ``at``: where the rover is, in the local frame; None: its commands may be sent from anywhere.
    """
    if not commands and not progress.open:
        return progress
    progress = given_up(progress)
    opened, on_way = list(progress.open), False
    for number, command in enumerate(commands):
        on_way = on_way or command.is_conditional
        due_s = None if on_way else now_s + command.after_s
        opened.append(OpenCommand(place, number, command, due_s, on_way, at=None if on_way else at))
    return replace(progress, open=tuple(opened))


def missed(progress: CommandProgress, place: int, commands: tuple[DoCommand, ...]) -> CommandProgress:
    """The place was not reached: none of its commands is sent."""
    for number in range(len(commands)):
        progress = counted(progress, place, number, CommandResult.LEFT_OUT, None)
    return progress


def given_up(progress: CommandProgress) -> CommandProgress:
    """The rover leaves: what has not been sent is left out; what may have been sent is still waited for, on the way."""
    kept = tuple(replace(one, on_way=True) for one in progress.open if one.announced)
    for one in progress.open:
        if not one.announced:
            progress = counted(progress, one.place, one.number, CommandResult.LEFT_OUT, None)
    return replace(progress, open=kept)


def carried(progress: CommandProgress, to: Callable[[NedPoint], NedPoint]) -> CommandProgress:
    """The same, with the places where the rover arrived in another frame. ``to``: where a place lies now."""
    opened = tuple(one if one.at is None else replace(one, at=to(one.at)) for one in progress.open)
    return replace(progress, open=opened)


def begun(progress: CommandProgress, now_s: float) -> CommandProgress:
    """The head's time begins to run when its turn has come."""
    head = progress.head
    if head is None or head.due_s is not None:
        return progress
    return replace(progress, open=(replace(head, due_s=now_s + (head.command.delay_s or 0.0)), *progress.open[1:]))


def is_due(head: OpenCommand, now_s: float, left_m: float) -> bool:
    """Whether the head is to be sent. ``left_m``: metres to the next target."""
    near = head.command.within_m is None or left_m < head.command.within_m
    return head.due_s is not None and now_s >= head.due_s and near


def announced(progress: CommandProgress) -> CommandProgress:
    """The head is about to be sent."""
    return replace(progress, open=(replace(progress.open[0], announced=True), *progress.open[1:]))


def settled(progress: CommandProgress, result: CommandResult, answer: int | None) -> CommandProgress:
    """The head has this result."""
    head = progress.open[0]
    return counted(replace(progress, open=progress.open[1:]), head.place, head.number, result, answer)


def counted(
    progress: CommandProgress, place: int, number: int, result: CommandResult, answer: int | None
) -> CommandProgress:
    """One more result of a command."""
    tallies = list(progress.tallies)
    at = next((i for i, one in enumerate(tallies) if (one.place, one.number) == (place, number)), len(tallies))
    before = tallies[at] if at < len(tallies) else CommandTally(place, number)
    counts = {**dict(before.counts), result: before.count(result) + 1}
    tallies[at : at + 1] = [CommandTally(place, number, tuple(sorted(counts.items())), answer)]
    return replace(progress, tallies=tuple(tallies))


def names(commands: Iterable[DoCommand]) -> str:
    """The commands in words."""
    return ", ".join(command.name for command in commands)
