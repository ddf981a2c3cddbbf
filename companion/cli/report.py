"""``rover-companion report``: a record as one HTML file, to look at and to pass on."""

from __future__ import annotations

import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, writable, written
from companion.mapping.map_files import MapError
from companion.recording.reader import Record, load_record
from companion.recording.record_format import RecordError
from companion.viewer.report_data import as_json, report_data
from companion.viewer.report_page import report_page

NAME = "report.html"


def report(
    directories: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Records; the tracks of further ones are laid over the first."),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Where the report goes; default: report.html in the first DIR.")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """Write a record as one HTML file: the drive at any moment, every decision with its why, tables.

    It needs no network and nothing else. Exit code 2: not to be read or written.
    """
    try:
        records = [load_record(directory) for directory in directories]
        file = out or directories[0] / NAME
        writable(file)
        for note in (note for record in records for note in record.notes):
            typer.echo(note, err=True)
        line = write_report(records, file)
    except (RecordError, MapError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(line)
    if show:
        webbrowser.open(file.resolve().as_uri())


def write_report(records: Sequence[Record], file: Path) -> str:
    """Write the report of a record, with the tracks of the others; a line for people says where it is.

    Raises RecordError, MapError, OutputError.
    """
    data = as_json(report_data(records[0], list(records[1:])))
    with written(file):
        file.write_text(report_page(records[0].mission.name, data), encoding="utf-8")
        return f"report: {file} ({file.stat().st_size / 1e6:.1f} MB)"
