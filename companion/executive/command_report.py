"""What became of the mission's commands, in words: a line for each, and one for all.

Nouns: command report.
"""

from __future__ import annotations

from companion.executive.command_progress import START, CommandProgress, CommandResult, CommandTally
from companion.executive.command_sender import result_text
from companion.mission.do_commands import DoCommand
from companion.mission.mission import Mission

ORDER = (CommandResult.ACCEPTED, CommandResult.REFUSED, CommandResult.UNANSWERED, CommandResult.LEFT_OUT)


def command_lines(mission: Mission, progress: CommandProgress | None) -> list[str]:
    """A line for each command of the mission, in their order. ``progress``: None before the mission has begun."""
    places = [(START, "the start", mission.commands)]
    places += [(number, target.name, target.commands) for number, target in enumerate(mission.targets)]
    found = {} if progress is None else {(tally.place, tally.number): tally for tally in progress.tallies}
    return [
        f"{command.name} at {name}: {_became(command, found.get((place, number)))}"
        for place, name, commands in places
        for number, command in enumerate(commands)
    ]


def commands_done(mission: Mission, progress: CommandProgress | None) -> str:
    """How many commands had which result, every time counted; empty for a mission without commands."""
    if not mission.commands and not any(target.commands for target in mission.targets):
        return ""
    counts = [] if progress is None else [(progress.total(result), result) for result in ORDER]
    return ", ".join(f"{count} {result}" for count, result in counts if count) or "none was sent"


def _became(command: DoCommand, tally: CommandTally | None) -> str:
    if tally is None:
        return "not sent"
    results = [(result, tally.count(result)) for result in ORDER if tally.count(result)]
    parts = []
    for result, count in results:
        why = f" ({result_text(tally.answer)})" if result is CommandResult.REFUSED and tally.answer is not None else ""
        parts.append(f"{result}{why}" if len(results) == 1 and count == 1 else f"{count} x {result}{why}")
    return ", ".join(parts)
