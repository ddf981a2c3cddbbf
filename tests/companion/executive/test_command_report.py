"""What became of the commands, in words."""

from __future__ import annotations

from companion.executive.command_progress import NO_COMMANDS, CommandResult, counted
from companion.executive.command_report import command_lines, commands_done
from companion.mission.do_commands import DoCommand, padded
from companion.mission.mission import HERE, Mission, Target

SERVO, GRIPPER = DoCommand(183, padded((9.0, 1900.0))), DoCommand(211, padded((0.0, 1.0)))
MISSION = Mission("m", (Target("gate", HERE, commands=(SERVO, GRIPPER)), Target("end", HERE)), commands=(GRIPPER,))


def test_each_has_a_line() -> None:
    progress = counted(NO_COMMANDS, -1, 0, CommandResult.REFUSED, 4)
    for _ in range(3):
        progress = counted(progress, 0, 0, CommandResult.ACCEPTED, 0)
    progress = counted(progress, 0, 0, CommandResult.UNANSWERED, None)
    assert command_lines(MISSION, progress) == [
        "DO_GRIPPER 0 1 at the start: refused (failed)",
        "DO_SET_SERVO 9 1900 at gate: 3 x accepted, 1 x unanswered",
        "DO_GRIPPER 0 1 at gate: not sent",
    ]
    assert commands_done(MISSION, progress) == "3 accepted, 1 refused, 1 unanswered"


def test_a_mission_without_commands_says_nothing() -> None:
    assert commands_done(Mission("m", (Target("end", HERE),)), NO_COMMANDS) == ""
    assert commands_done(MISSION, None) == "none was sent"
