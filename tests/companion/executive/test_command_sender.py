"""One command at a time, announced before it goes, repeated until it is answered, told when it is refused."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from companion.executive.command_progress import NO_COMMANDS, CommandProgress, CommandResult, announced, arrived
from companion.executive.command_sender import CommandSender
from companion.mission.do_commands import DoCommand, padded
from companion.vehicle.commands import RunCommand
from companion.vehicle.events import AckSeen
from tests.support.notices import Notices

SERVO, TOGGLE = DoCommand(183, padded((9.0, 1900.0))), DoCommand(181, padded((0.0, 2.0)))


@dataclass
class Bench:
    """A sender, ticked 20 times a second."""

    progress: CommandProgress
    told: Notices = field(default_factory=Notices)
    now_s: float = 0.0
    saves: bool = True
    away: bool = False
    sent: list[tuple[float, RunCommand]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.sender = CommandSender(self.told)

    def run(self, seconds: float) -> list[RunCommand]:
        before = len(self.sent)
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.progress, command = self.sender.due(self.progress, self.now_s, 0.0, 0.1, "gate", away=self.away)
            if command is not None:
                self.sent.append((self.now_s, command))
            if self.saves and self.sender.awaits_save(self.progress):
                self.sender.saved()
        return [command for _, command in self.sent[before:]]

    def answer(self, command: int, result: int) -> None:
        self.progress = self.sender.answered(self.progress, AckSeen(self.now_s, command, result), "gate")

    def count(self, result: CommandResult) -> int:
        return self.progress.total(result)


def bench(*commands: DoCommand) -> Bench:
    return Bench(arrived(NO_COMMANDS, 0, commands, 0.0))


def test_commands_go_one_by_one_and_are_told() -> None:
    one = bench(SERVO, TOGGLE)
    assert [command.number for command in one.run(0.5)] == [183]
    one.answer(400, 0)
    assert one.run(0.2) == []
    one.answer(183, 0)
    assert [command.number for command in one.run(0.3)] == [181]
    one.answer(181, 4)
    assert one.told.texts == ["DO_SET_SERVO 9 1900 at gate: accepted", "DO_SET_RELAY 0 2 at gate: refused (failed)"]
    assert one.run(5.0) == [] and one.progress.open == ()


def test_nothing_goes_before_it_is_announced_and_saved_but_a_dead_disk_stops_nothing() -> None:
    one = bench(SERVO)
    one.saves = False
    assert one.run(0.9) == [] and one.progress.open[0].announced
    assert len(one.run(0.3)) == 1


def test_a_lost_command_is_repeated_and_counted_and_at_last_given_up() -> None:
    one = bench(SERVO)
    assert [command.repetition for command in one.run(8.0)] == [0, 1, 2]
    times = [time_s for time_s, _ in one.sent]
    assert times[1] - times[0] == pytest.approx(1.2, abs=0.06), "a second and the link's latency there and back"
    assert one.count(CommandResult.UNANSWERED) == 1
    assert one.told.texts == ["DO_SET_SERVO 9 1900 at gate: unanswered after 3 tries"]


def test_what_must_not_arrive_twice_is_sent_once() -> None:
    one = bench(TOGGLE)
    assert len(one.run(8.0)) == 1 and one.count(CommandResult.UNANSWERED) == 1


def test_a_second_answer_to_a_repetition_is_not_the_next_commands() -> None:
    one = bench(SERVO, SERVO)
    one.run(1.5)
    assert len(one.sent) == 2
    one.answer(183, 0)
    assert len(one.run(0.2)) == 1
    one.answer(183, 0)
    assert one.progress.head is not None, "it answered the repetition"
    one.answer(183, 2)
    assert (one.count(CommandResult.ACCEPTED), one.count(CommandResult.REFUSED)) == (1, 1)


def test_rejected_for_now_is_tried_again_and_in_progress_waited_for() -> None:
    one = bench(TOGGLE, SERVO)
    one.run(0.2)
    one.answer(181, 1)
    assert len(one.run(1.5)) == 1
    one.answer(181, 0)
    one.run(0.2)
    one.answer(183, 5)
    assert one.run(20.0) == []
    one.answer(183, 0)
    assert one.count(CommandResult.ACCEPTED) == 2


@pytest.mark.parametrize(("command", "again"), [(SERVO, 1), (TOGGLE, 0)])
def test_taken_up_again(command: DoCommand, again: int) -> None:
    one = Bench(announced(arrived(NO_COMMANDS, 0, (command,), 0.0)))
    one.progress = one.sender.resume(one.progress, "gate")
    assert len(one.run(0.3)) == again
    said = "sent again" if again else "not sent again, its result is not known"
    assert one.told.texts == [f"{command.name} at gate may have been sent before: {said}"]
    assert one.count(CommandResult.UNANSWERED) == 1 - again


def test_what_was_not_announced_is_taken_up_without_a_word() -> None:
    one = bench(TOGGLE)
    one.progress = one.sender.resume(one.progress, "gate")
    assert one.told.texts == [] and len(one.run(0.3)) == 1


def test_away_from_its_place_a_command_is_neither_sent_nor_repeated() -> None:
    one = bench(SERVO, TOGGLE)
    one.run(0.5)
    one.away = True
    assert one.run(1.0) == [] and len(one.sent) == 1, "its answer does not come, and it is not repeated"
    assert one.run(0.3) == [] and one.progress.open == ()
    assert (one.count(CommandResult.UNANSWERED), one.count(CommandResult.LEFT_OUT)) == (1, 1)
    assert one.told.texts[-1] == "Not sent, the rover is not at gate any more: DO_SET_RELAY 0 2"


def test_a_rejection_stands_when_the_rover_has_left() -> None:
    one = bench(SERVO)
    one.run(0.2)
    one.answer(183, 1)
    one.away = True
    assert one.run(2.0) == [] and one.count(CommandResult.REFUSED) == 1


def test_what_an_earlier_run_may_have_sent_elsewhere_is_not_sent_here() -> None:
    one = Bench(announced(arrived(NO_COMMANDS, 0, (SERVO,), 0.0)), away=True)
    one.progress = one.sender.resume(one.progress, "gate")
    assert one.run(1.0) == [] and one.count(CommandResult.UNANSWERED) == 1


def test_a_lost_answer_does_not_swallow_the_next_commands_answer() -> None:
    """What must not arrive twice: of two in a row, one answer came."""
    one = bench(TOGGLE, TOGGLE, TOGGLE)
    one.run(3.5)
    assert len(one.sent) == 2 and one.count(CommandResult.UNANSWERED) == 1
    one.answer(181, 0)
    one.run(3.5)
    assert (one.count(CommandResult.ACCEPTED), one.count(CommandResult.UNANSWERED), len(one.sent)) == (1, 1, 3)
    assert one.told.texts[-1] == "DO_SET_RELAY 0 2 at gate: accepted, or the one before it was"
    one.answer(181, 0)
    assert one.told.texts[-1] == "DO_SET_RELAY 0 2 at gate: accepted" and one.progress.open == ()


def test_a_late_answer_and_ones_own_are_told_apart_by_their_number() -> None:
    one = bench(TOGGLE, TOGGLE)
    one.run(3.5)
    one.answer(181, 0)
    one.answer(181, 4)
    assert one.told.texts[-1] == "DO_SET_RELAY 0 2 at gate: refused (failed)" and one.progress.open == ()


def test_after_three_lost_answers_the_same_command_is_repeated_and_its_answers_count() -> None:
    one = bench(SERVO, SERVO)
    one.run(3.9)
    assert one.count(CommandResult.UNANSWERED) == 1
    for _ in range(3):
        one.answer(183, 0)
        one.run(1.25)
    assert one.count(CommandResult.ACCEPTED) == 1 and len(one.sent) == 6


def test_an_answered_rejection_leaves_no_answer_outstanding() -> None:
    one = bench(TOGGLE, TOGGLE)
    one.run(0.2)
    one.answer(181, 1)
    one.run(1.2)
    one.answer(181, 0)
    one.run(0.2)
    one.answer(181, 0)
    assert one.count(CommandResult.ACCEPTED) == 2 and all(text.endswith("accepted") for text in one.told.texts)
