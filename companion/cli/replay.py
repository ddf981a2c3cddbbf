"""``rover-companion replay``: runs a recorded companion again and compares; lists decisions, explains one."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.images import save_decision, save_motions
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, picture
from companion.cli.plan import plan_command
from companion.cli.replay_progress import watched_replay
from companion.core.grid import BASE_WEIGHT
from companion.mapping.map_files import MapError, save_weighed_map
from companion.recording.contacts import COLLISIONS, contacts_of
from companion.recording.reader import Record, load_record
from companion.recording.record_clock import record_clock
from companion.recording.record_format import RecordError
from companion.replay.decision_list import DecisionLister, decision_at, list_lines
from companion.replay.explain import DecisionExplainer, Explanation, explanation_lines
from companion.replay.replay import ReplayResult

EXIT_SAME, EXIT_DIFFERENT = 0, 1
SHOWN = 20


def replay(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="What run or drive wrote with --record.")],
    why: Annotated[
        str | None,
        typer.Option(
            metavar="MOMENT",
            help="Show why a decision was made: its number (66), or the one in force so long after the start "
            "(83.5s or 1:23) or at a time of day (14:03:22).",
        ),
    ] = None,
    show_list: Annotated[
        bool, typer.Option("--list", help="List all decisions, and what happened between them.")
    ] = False,
    image: Annotated[
        Path | None, typer.Option(help="With --why: where the picture goes; default: why-NUMBER.png in DIR.")
    ] = None,
) -> None:
    """Run the decisions of a record again and print the differences.

    Exit code 0: none; 1: some; 2: not to be replayed.
    """
    try:
        record = load_record(directory)
        if image is not None and why is None:
            raise OutputError("--image goes with --why: it shows one decision")
        if show_list and why is not None:
            raise OutputError("--list and --why do not go together: list the decisions, then ask for one")
        if show_list:
            result = _listed(record)
        elif why is not None:
            result = _explained(record, why, image)
        else:
            result = watched_replay(record)
    except (RecordError, MapError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    _print(record, result)
    for line in _collisions(directory):
        typer.echo(line)
    raise typer.Exit(EXIT_DIFFERENT if result.differences else EXIT_SAME)


def _listed(record: Record) -> ReplayResult:
    """Replay, and print the list of decisions."""
    clock, lister = record_clock(record), DecisionLister()
    result = watched_replay(record, lister)
    with contextlib.suppress(OSError, ValueError):  # a file that cannot be read is told after the list
        lister.add_contacts(contacts_of(record.directory), clock)
    typer.echo(f"{record.directory}: {clock.described}")
    for line in list_lines(lister.listed, clock):
        typer.echo(line)
    return result


def _explained(record: Record, why: str, image: Path | None) -> ReplayResult:
    """Replay, and explain the decision that was asked for."""
    number = decision_at(record, record_clock(record), why)
    shown, fault = image or record.directory / f"why-{number}.png", ""
    try:
        picture(shown)
    except OutputError as error:
        if image is not None:
            raise
        fault = f"no picture: {error}; name another place with --image"  # nobody asked for one there
    explainer = DecisionExplainer(number, record.settings, record.mission.rover.turning_radius_m)
    result = watched_replay(record, explainer)
    if explainer.explanation is None:
        raise RecordError(f"{record.directory}: what is left of it ends before decision {number}")
    for line in explanation_lines(explainer.explanation):
        typer.echo(line)
    if fault:
        typer.echo(fault, err=True)
    else:
        _draw(explainer.explanation, shown)
        _tell_how_to_plan(record, explainer.explanation, shown)
    return result


def _draw(explanation: Explanation, image: Path) -> None:
    save_decision(image, explanation)
    typer.echo(f"picture: {image}")
    if (choice := explanation.motions) is not None:
        beside = image.with_name(f"{image.stem}-motions{image.suffix}")
        save_motions(beside, choice, f"after decision {explanation.number}")
        typer.echo(f"picture of the motions: {beside}")


def _tell_how_to_plan(record: Record, explanation: Explanation, image: Path) -> None:
    """A command that plans on the weights that the last search of the decision was given."""
    if explanation.problem is None:
        return
    stem = image.with_name(f"{image.stem}-map")
    save_weighed_map(explanation.weighed.with_weights(explanation.problem.weights), stem)
    command = plan_command(explanation.problem, explanation.weighed.resolution_m, record.settings, stem)
    typer.echo(f"to plan it again: {command}")
    if float(explanation.problem.weights.min()) < BASE_WEIGHT:
        typer.echo(f"  (ground that the mission prefers has the usual weight, {BASE_WEIGHT:g}, in this map)")


def _collisions(directory: Path) -> list[str]:
    """The contacts of a simulated drive, a line each; times are the simulator's."""
    try:
        contacts = contacts_of(directory)
        lines = [
            f"collision at {one['time_s']} s of the simulation: {one['with']}, {one['speed_m_s']} m/s, "
            f"north {one['north_m']} m, east {one['east_m']} m of the start"
            for one in contacts
        ]
    except (OSError, ValueError):
        return [f"{directory / COLLISIONS}: cannot be read; delete it, or drive again with --record"]
    more = len(lines) - SHOWN
    return [*lines[:SHOWN], *([f"... and {more} more collisions"] if more > 0 else [])]


def _print(record: Record, result: ReplayResult) -> None:
    for note in record.notes:
        typer.echo(note, err=True)
    for name, status in result.targets:
        typer.echo(f"{name}: {status}")
    typer.echo(
        f"{record.mission.name}: {result.seconds:.1f} s, {result.ticks} ticks, {result.heard} packets heard, "
        f"{result.said} said, {result.decisions} decisions"
    )
    for line in result.differences[:SHOWN]:
        typer.echo(line)
    if len(result.differences) > SHOWN:
        typer.echo(f"... and {len(result.differences) - SHOWN} more")
    typer.echo(f"differences: {len(result.differences) or 'none'}")
