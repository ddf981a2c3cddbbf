"""``rover-companion report``: a record as one HTML file, and in other forms: CSV, MCAP, a film."""

from __future__ import annotations

import webbrowser
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, apart, writable, written
from companion.mapping.map_files import MapError
from companion.recording.reader import Record, files_of, load_record
from companion.recording.record_clock import record_clock
from companion.recording.record_format import RecordError
from companion.replay.replay import Observers, ReplayObserver, ReplayResult, replay
from companion.storage.files import refuse_pipe
from companion.viewer.report_csv import FILES, CsvReport
from companion.viewer.report_data import ReportWatch, as_json, counted, joined, run_of
from companion.viewer.report_mcap import McapError, McapReport, check_mcap
from companion.viewer.report_page import report_page
from companion.viewer.report_tables import Run, differences
from companion.viewer.run_tally import RunTally

NAME = "report.html"


def report(
    directories: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Records; further ones are compared with the first."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the HTML file goes; default: report.html in the first DIR, none if another form is asked for."
        ),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help=f"Write tables of the first DIR: {', '.join(FILES)}.")
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the first DIR for Foxglove and Lichtblick (needs rover-companion[mcap])."
        ),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the HTML file in the browser.")] = False,
) -> None:
    """Write a record as one HTML file: the drive at any moment, every decision with its why, tables.

    It needs no network and nothing else. Several records are compared, in the file and here. Exit code 2: not to be
    read or written.
    """
    try:
        records = [load_record(directory) for directory in directories]
        page = out if out is not None or csv or mcap else directories[0] / NAME
        if show and page is None:
            raise OutputError("--open shows the HTML file: name it with --out as well")
        _check(records, page, csv, mcap)
        for note in (note for record in records for note in record.notes):
            typer.echo(note, err=True)
        runs = _made(records, page, csv, mcap)
    except (RecordError, MapError, McapError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if len(runs) > 1:
        _compare(runs)
    if show and page is not None:
        webbrowser.open(page.resolve().as_uri())


def _check(records: Sequence[Record], page: Path | None, csv: Path | None, mcap: Path | None) -> None:
    """All that can be wrong with the outputs, before the work. Raises OutputError or McapError."""
    tables = [] if csv is None else [csv / name for name in FILES]
    outputs = [one for one in (page, mcap, *tables) if one is not None]
    for one in outputs:
        writable(one)
    apart(outputs, [file for record in records for file in files_of(record)])
    if mcap is not None:
        check_mcap()


def _made(records: Sequence[Record], page: Path | None, csv: Path | None, mcap: Path | None) -> list[Run]:
    """Run the first record again, and write what was asked for; then the others, to compare."""
    first = records[0]
    clock, tally = record_clock(first), RunTally()
    watched = None if page is None else ReportWatch(first)
    observers: list[ReplayObserver] = [tally, *([] if watched is None else [watched])]
    with ExitStack() as stack:
        if csv is not None:
            stack.enter_context(written(csv))
            tables = CsvReport(csv, clock)
            stack.callback(tables.close)
            observers.append(tables)
        if mcap is not None:
            stack.enter_context(written(mcap))
            refuse_pipe(mcap)
            messages = McapReport(mcap, clock)
            stack.callback(messages.close)
            observers.append(messages)
        result: ReplayResult = replay(first, Observers(observers))
    runs = [run_of(first, tally, result), *(counted(one) for one in records[1:])]
    if csv is not None:
        typer.echo(f"tables: {csv} ({', '.join(FILES)})")
    if mcap is not None:
        typer.echo(f"messages: {mcap} ({mcap.stat().st_size / 1e6:.1f} MB)")
    if page is not None and watched is not None:
        data = as_json(joined(first, watched, runs[0], runs[1:]))
        with written(page):
            page.write_text(report_page(first.mission.name, data), encoding="utf-8")
        typer.echo(f"report: {page} ({page.stat().st_size / 1e6:.1f} MB)")
    return runs


def _compare(runs: list[Run]) -> None:
    """The differences on the terminal."""
    found = differences(runs)
    table = Table(box=None, pad_edge=False)
    for number, name in enumerate(found["head"]):
        table.add_column(name.replace("[", "\\["), justify="right" if number else "left", overflow="fold")
    for row in found["rows"]:
        table.add_row(*row)
    Console().print(table, highlight=False)
