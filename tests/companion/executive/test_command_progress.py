"""Which command is due: at its place, after its time, on the way, or never."""

from __future__ import annotations

from companion.core.frames import NedPoint
from companion.executive.command_progress import (
    NO_COMMANDS,
    CommandResult,
    announced,
    arrived,
    begun,
    carried,
    given_up,
    is_due,
    missed,
    settled,
)
from companion.mission.do_commands import DoCommand, padded


def servo(pwm: float, **when: float) -> DoCommand:
    return DoCommand(183, padded((9.0, pwm)), **when)  # type: ignore[arg-type]


def test_a_place_keeps_the_rover_until_its_commands_are_done() -> None:
    progress = arrived(NO_COMMANDS, 0, (servo(1), servo(2, after_s=5.0)), 100.0)
    assert progress.keeps_here and progress.head is not None and progress.head.due_s == 100.0
    progress = settled(progress, CommandResult.ACCEPTED, 0)
    assert progress.keeps_here and not is_due(progress.open[0], 104.9, 0.0) and is_due(progress.open[0], 105.0, 0.0)
    progress = settled(progress, CommandResult.REFUSED, 4)
    assert not progress.keeps_here and [tally.answer for tally in progress.tallies] == [0, 4]
    assert progress.total(CommandResult.ACCEPTED, CommandResult.REFUSED) == 2


def test_behind_a_condition_the_rover_goes_on_and_the_clock_starts_with_the_turn() -> None:
    progress = arrived(NO_COMMANDS, 0, (servo(1), servo(2, delay_s=3.0), servo(3), servo(4, within_m=5.0)), 10.0)
    progress = settled(progress, CommandResult.ACCEPTED, 0)
    assert not progress.keeps_here
    progress = begun(progress, 12.0)
    assert progress.open[0].due_s == 15.0 and begun(progress, 13.0) == progress
    progress = begun(settled(progress, CommandResult.ACCEPTED, 0), 16.0)
    assert is_due(progress.open[0], 16.0, 50.0), "what follows has no condition of its own"
    progress = begun(settled(progress, CommandResult.ACCEPTED, 0), 17.0)
    assert not is_due(progress.open[0], 17.0, 5.0) and is_due(progress.open[0], 17.0, 4.9)


def test_the_next_place_leaves_out_what_was_not_due_but_waits_for_what_may_have_been_sent() -> None:
    progress = begun(arrived(NO_COMMANDS, 0, (servo(1, delay_s=1.0), servo(2)), 0.0), 0.0)
    progress = arrived(announced(progress), 1, (servo(3),), 5.0)
    assert [(one.place, one.number, one.on_way) for one in progress.open] == [(0, 0, True), (1, 0, False)]
    assert progress.total(CommandResult.LEFT_OUT) == 1
    assert given_up(progress).open == progress.open[:1]


def test_what_belongs_to_a_place_knows_where_the_rover_arrived() -> None:
    progress = arrived(NO_COMMANDS, 0, (servo(1), servo(2, delay_s=1.0), servo(3)), 0.0, NedPoint(3.0, 4.0))
    progress = carried(progress, lambda point: NedPoint(point.north_m + 10.0, point.east_m))
    assert [one.at for one in progress.open] == [NedPoint(13.0, 4.0), None, None]
    here, on_way = progress.open[:2]
    assert here.is_left_by(NedPoint(13.0, 5.6), 1.5) and not here.is_left_by(NedPoint(13.0, 5.4), 1.5)
    assert not on_way.is_left_by(NedPoint(0.0, 0.0), 1.5)


def test_a_place_that_was_missed_leaves_all_out() -> None:
    progress = missed(missed(NO_COMMANDS, 2, (servo(1), servo(2))), 2, (servo(1),))
    assert [(tally.number, tally.count(CommandResult.LEFT_OUT)) for tally in progress.tallies] == [(0, 2), (1, 1)]
    assert arrived(NO_COMMANDS, 0, (), 1.0) is NO_COMMANDS
