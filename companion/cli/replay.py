"""``rover-companion replay``: run a recorded companion again, and compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from companion.mapfiles import MapError
from companion.record import Record, load_record
from companion.recorded_files import RecordError
from companion.replay import Replayed
from companion.replay import replay as run_again

EXIT_SAME, EXIT_DIFFERENT, EXIT_BAD_INPUT = 0, 1, 2
SHOWN = 20


def replay(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="What run or drive wrote with --record.")],
) -> None:
    """Run the decisions of a record again and print the differences. Exit code 0: none; 1: some; 2: not to be replayed."""
    try:
        record = load_record(directory)
        result = run_again(record)
    except (RecordError, MapError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    _print(record, result)
    raise typer.Exit(EXIT_DIFFERENT if result.differences else EXIT_SAME)


def _print(record: Record, result: Replayed) -> None:
    for note in record.notes:
        typer.echo(note, err=True)
    for name, status in result.targets:
        typer.echo(f"{name}: {status}")
    typer.echo(
        f"{record.mission.name}: {result.seconds:.1f} s, {result.rounds} rounds, {result.heard} packets heard, "
        f"{result.said} said, {result.decisions} decisions"
    )
    for line in result.differences[:SHOWN]:
        typer.echo(line)
    if len(result.differences) > SHOWN:
        typer.echo(f"... and {len(result.differences) - SHOWN} more")
    typer.echo(f"differences: {len(result.differences) or 'none'}")
