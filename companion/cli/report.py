"""``rover-companion report``: a record as one HTML file, and in other forms: CSV, MCAP, a film."""

from __future__ import annotations

import contextlib
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, apart, replaced, writable, written
from companion.cli.replay_progress import watched_replay
from companion.mapping.map_files import MapError
from companion.recording.reader import Record, files_of, load_record
from companion.recording.record_clock import record_clock
from companion.recording.record_format import RecordError
from companion.replay.replay import ReplayObserver
from companion.storage.files import whole_file
from companion.viewer.report_csv import FILES, CsvReport
from companion.viewer.report_data import ReportWatch, as_json, counted, joined, named, run_of
from companion.viewer.report_film import Film, FilmError, check_ffmpeg, write_gif, write_mp4
from companion.viewer.report_mcap import McapError, McapReport, check_mcap
from companion.viewer.report_page import report_page
from companion.viewer.report_tables import Run, differences
from companion.viewer.run_tally import RunTally

NAME = "report.html"


@dataclass(frozen=True, slots=True)
class Forms:
    """Where each form of a report goes; None for those that are not wanted."""

    page: Path | None
    csv: Path | None
    mcap: Path | None
    gif: Path | None
    mp4: Path | None

    @property
    def suffixes(self) -> list[tuple[str, Path | None, tuple[str, ...]]]:
        """How the name of each must end, so that a slip of the keyboard writes over nothing else."""
        return [
            ("--out", self.page, (".html", ".htm")), ("--mcap", self.mcap, (".mcap",)), ("--gif", self.gif, (".gif",)),
            ("--mp4", self.mp4, (".mp4",)),
        ]  # fmt: skip

    @property
    def files(self) -> list[Path]:
        """Every file that will be written."""
        tables = [] if self.csv is None else [self.csv / name for name in FILES]
        return [one for one in (self.page, self.mcap, self.gif, self.mp4, *tables) if one is not None]


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
        typer.Option(metavar="FILE", help="Write the first DIR for Foxglove and Lichtblick (needs the extra `mcap`)."),
    ] = None,
    gif: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the drive of the first DIR as a short film, animated GIF."),
    ] = None,
    mp4: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The same film as MP4 (needs the program ffmpeg).")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the HTML file in the browser.")] = False,
) -> None:
    """Write a record as one HTML file: the drive at any moment, every decision with its why, tables.

    It needs no network and nothing else. Several records are compared, in the file and here. Exit code 2: not to be
    read or written.
    """
    try:
        _refuse_twice(directories)
        records = [load_record(directory) for directory in directories]
        page = out if out or csv or mcap or gif or mp4 else directories[0] / NAME
        if show and page is None:
            raise OutputError("--open shows the HTML file: name it with --out as well")
        forms = Forms(page, csv, mcap, gif, mp4)
        with _no_empty_folder(csv):
            _check(records, forms)
            for note in (note for record in records for note in record.notes):
                typer.echo(note, err=True)
            runs = _made(records, forms)
    except (RecordError, MapError, McapError, FilmError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if len(runs) > 1:
        _compare(runs)
    if show and page is not None:
        address = page.resolve().as_uri()
        if not webbrowser.open(address):
            typer.echo(f"no browser was found on this computer; open {address}", err=True)


@contextlib.contextmanager
def _no_empty_folder(folder: Path | None) -> Iterator[None]:
    """A context after whose errors, or Ctrl-C, a folder that was made in it is gone, if nothing is in it."""
    existed = folder is None or folder.exists()
    try:
        yield
    except BaseException:
        if folder is not None and not existed:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _check(records: Sequence[Record], forms: Forms) -> None:
    """All that can be wrong, before anything is made. Raises RecordError, OutputError, McapError or FilmError."""
    _refuse_silent(records[0])
    for option, file, suffix in forms.suffixes:
        if file is not None and file.suffix.lower() not in suffix:
            raise OutputError(f"{option} {file}: the name must end with {suffix[0]}")
    apart(forms.files, [file for record in records for file in files_of(record)])
    if forms.mcap is not None:
        check_mcap()
    if forms.mp4 is not None:
        check_ffmpeg()
    for file in forms.files:
        writable(file)


def _made(records: Sequence[Record], forms: Forms) -> list[Run]:
    """Run the first record again, and write what was asked for; then the others, to compare."""
    first = records[0]
    clock, tally = record_clock(first), RunTally()
    watched = None if (forms.page or forms.gif or forms.mp4) is None else ReportWatch(first)
    observers: list[ReplayObserver] = [tally, *([] if watched is None else [watched])]
    with ExitStack() as stack:
        if forms.csv is not None:
            stack.enter_context(written(forms.csv))
            tables = CsvReport({name: stack.enter_context(whole_file(forms.csv / name)) for name in FILES}, clock)
            stack.callback(tables.close)
            observers.append(tables)
        if forms.mcap is not None:
            messages = McapReport(stack.enter_context(replaced(forms.mcap)), clock)
            stack.callback(messages.close)
            observers.append(messages)
        result = watched_replay(first, *observers)
    runs = named([run_of(first, tally, result), *(counted(one, watched_replay) for one in records[1:])])
    if forms.csv is not None:
        typer.echo(f"tables: {forms.csv} ({', '.join(FILES)})")
    if forms.mcap is not None:
        _tell("messages", forms.mcap)
    if watched is not None:
        _write(first, joined(first, watched, runs[0], runs[1:]), forms)
    return runs


def _write(record: Record, data: dict[str, Any], forms: Forms) -> None:
    """The forms that are made of the report's data."""
    if forms.gif is not None:
        with replaced(forms.gif) as new:
            write_gif(Film(data), new)
        _tell("film", forms.gif)
    if forms.mp4 is not None:
        with replaced(forms.mp4) as new:
            write_mp4(Film(data), new)
        _tell("film", forms.mp4)
    if forms.page is not None:
        typer.echo(_page_written(record, data, forms.page))


def write_report(record: Record, file: Path) -> str:
    """Write the report of a record; a line for people says where it is.

    Raises RecordError, MapError, OutputError.
    """
    _refuse_silent(record)
    tally, watched = RunTally(), ReportWatch(record)
    result = watched_replay(record, tally, watched)
    run = named([run_of(record, tally, result)])[0]
    return _page_written(record, joined(record, watched, run, []), file)


def _refuse_twice(directories: Sequence[Path]) -> None:
    """Raises RecordError where a record would be compared with itself."""
    places = [directory.resolve() for directory in directories]
    for number, place in enumerate(places):
        if place in places[:number]:
            raise RecordError(f"{directories[number]}: is named twice; name each record once")


def _refuse_silent(record: Record) -> None:
    """Raises RecordError where no autopilot was heard, before any file is made."""
    if not any(tick.heard for tick in record.ticks()):
        raise RecordError(f"{record.directory}: no packet of an autopilot is in it; there is nothing to show")


def _page_written(record: Record, data: dict[str, Any], file: Path) -> str:
    with replaced(file) as new:
        new.write_text(report_page(record.mission.name, as_json(data)), encoding="utf-8")
    return _line("report", file)


def _tell(what: str, file: Path) -> None:
    typer.echo(_line(what, file))


def _line(what: str, file: Path) -> str:
    size = file.stat().st_size
    told = f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{max(size / 1e3, 1.0):.0f} kB"
    return f"{what}: {file} ({told})"


def _compare(runs: list[Run]) -> None:
    """The differences on the terminal."""
    found = differences(runs)
    table = Table(box=None, pad_edge=False)
    for number, name in enumerate(found["head"]):
        table.add_column(name.replace("[", "\\["), justify="right" if number else "left", overflow="fold")
    for row in found["rows"]:
        table.add_row(*row)
    Console().print(table, highlight=False)
