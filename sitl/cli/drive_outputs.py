"""Results of ``drive``: a table on the terminal, and the files that were requested."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from companion.cli.inputs import OutputError, apart, picture, replaced, writable, written
from companion.cli.report import write_report
from companion.mapping.map_files import MapError
from companion.recording.reader import load_record
from companion.recording.record_format import RecordError
from companion.recording.recorder import NullRecorder, Recorder
from companion.settings.versions import made_with
from sitl.lockstep import Drive, Report
from sitl.view.picture import save_picture

LAPS_SHOWN = 20
CONTACTS_SHOWN = 3
"""The table shows the first of them; --json has all."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files to write; ``map_stem``: name of two files, without their suffixes; ``record``: a folder."""

    image: Path | None = None
    map_stem: Path | None = None
    json_file: Path | None = None
    report: Path | None = None
    record: Path | None = None

    @property
    def lines(self) -> int:
        """So many lines tell at the end where the files are, but for the record's."""
        return sum(file is not None for file in (self.image, self.map_stem, self.json_file))

    def check(self, inputs: Iterable[Path | None]) -> None:
        """Check before the drive that all can be written, over no input and no other output. Raises OutputError."""
        maps = [] if self.map_stem is None else [Path(f"{self.map_stem}{end}") for end in (".yaml", ".pgm")]
        apart((self.image, self.json_file, self.report, *maps, self.record), inputs)
        picture(self.image)
        writable(self.json_file)
        writable(self.report)
        writable(self.map_stem, ".yaml")

    @contextmanager
    def record_folder(self) -> Iterator[Path | None]:
        """Where the drive is recorded; for a report alone a folder beside it that is deleted in the end. None: nowhere.

        Raises OutputError.
        """
        if self.record is not None or self.report is None:
            yield self.record
            return
        with written(self.report.parent):
            folder = tempfile.TemporaryDirectory(prefix=".record-", dir=self.report.parent, ignore_cleanup_errors=True)
        with folder as path:
            yield Path(path)

    @contextmanager
    def asked_for(self) -> Iterator[None]:
        """A context in which the record is begun; where nobody asked for one, an error names the report. Raises
        OutputError and RecordError.
        """
        try:
            yield
        except RecordError as error:
            if self.record is not None or not isinstance(error.__cause__, OSError):
                raise
            reason = error.__cause__.strerror or error.__cause__
            raise OutputError(f"{self.report}: cannot be written: {reason}; choose another place") from error

    def write(self, run: Drive, recorder: Recorder | NullRecorder, console: Console) -> None:
        """Write the files, complete the record with its map, and print where they are.

        All are written even if one fails; then raises OutputError.
        """
        problems = []
        report = partial(self.write_report, recorder, console)
        end = partial(self._end_record, recorder)
        for write in (end, self._write_image, self._write_map, self._write_figures, report):
            try:
                line = write(run)
            except (OutputError, MapError, RecordError) as error:
                problems.append(str(error))
            else:
                if line:
                    console.print(line, soft_wrap=True, markup=False, highlight=False)
        if problems:
            raise OutputError("\n".join(problems))

    def _write_image(self, run: Drive) -> str:
        if self.image is None:
            return ""
        with replaced(self.image) as new:
            save_picture(run, new)
        return f"picture: {self.image}"

    def _write_map(self, run: Drive) -> str:
        if self.map_stem is None:
            return ""
        if not run.companion.save_map(self.map_stem):
            return "map:     none, the mission did not begin"
        return f"map:     {self.map_stem}.yaml"

    def _end_record(self, recorder: Recorder | NullRecorder, run: Drive) -> str:
        if not isinstance(recorder, Recorder):
            return ""
        if recorder.problem:
            return recorder.problem  # a record that ends early does not change the result of the run
        complete_record(run, recorder)
        return "" if self.record is None else f"record:  {recorder.directory}"

    def write_report(self, recorder: Recorder | NullRecorder, console: Console, run: Drive) -> str:
        """Of the record as it lies there now, if it is asked for. Raises OutputError, MapError, RecordError."""
        if self.report is None or not isinstance(recorder, Recorder):
            return ""
        with console.status("writing the report ..."):
            line = write_report(load_record(recorder.directory), self.report)
        return line.replace("report:", "report: ", 1)

    def _write_figures(self, run: Drive) -> str:
        if self.json_file is None:
            return ""
        text = json.dumps({**run.report.as_json(), **made_with(run.settings)}, indent=2) + "\n"
        with replaced(self.json_file) as new:
            new.write_text(text, encoding="utf-8")
        return f"figures: {self.json_file}"


def _contacts_text(report: Report) -> str:
    """How many, and the first few: when, with what, how fast, where."""
    lines = [f"{report.collisions}"]
    for contact in report.contacts[:CONTACTS_SHOWN]:
        place = f"north {contact['north_m']} m, east {contact['east_m']} m of the start"
        lines.append(f"{contact['time_s']} s: {contact['with']}, {contact['speed_m_s']} m/s, {place}")
    more = len(report.contacts) - CONTACTS_SHOWN
    if more > 0:
        lines.append(f"and {more} more: --json has all, and so has collisions.json of a record")
    return "\n".join(lines)


def complete_record(run: Drive, recorder: Recorder) -> None:
    """The files of a record that are written at its end. Raises OutputError or MapError."""
    _write_collisions(run, recorder)
    run.companion.save_map(recorder.directory / "map")


def _write_collisions(run: Drive, recorder: Recorder) -> None:
    """All contacts, if there are any."""
    contacts = run.contacts
    if contacts:
        file = recorder.directory / "collisions.json"
        with replaced(file) as new:
            new.write_text(json.dumps(contacts, indent=2) + "\n", encoding="utf-8")


def outputs(
    image: Path | None,
    map_stem: Path | None,
    json_file: Path | None,
    report: Path | None = None,
    record: Path | None = None,
) -> Outputs:
    """The files of the options; a map may be named with one of its two suffixes."""
    bare = map_stem and map_stem.suffix in (".yaml", ".pgm")
    stem = map_stem.with_suffix("") if map_stem and bare else map_stem
    return Outputs(image, stem, json_file, report, record)


def print_summary(report: Report, console: Console) -> None:
    """Print the results of a run."""
    table = Table(title=f"outcome: {report.outcome}", show_header=False)
    for name, status in report.targets:
        table.add_row(f"target {name}", status)
    for number, line in enumerate(report.commands):
        table.add_row("commands" if number == 0 else "", line)
    for number, line in enumerate(report.laps[-LAPS_SHOWN:]):
        table.add_row("laps" if number == 0 else "", line)
    speed = report.distance_m / report.driving_time_s if report.driving_time_s else 0.0
    rows = {
        "collisions": _contacts_text(report),
        "driven": f"{report.distance_m:.1f} m in {report.driving_time_s:.0f} s ({speed:.2f} m/s)",
        "steps": f"{report.steps} fields, {report.return_steps} of them going back, {report.searches} searches",
        "stuck": "never" if report.stuck == 0 else f"{report.stuck} x",
        "planning": f"{1e3 * report.planning_time_s:.1f} ms in total; "
        f"99 % of ticks (20 a second) within {report.tick_p99_ms:.2f} ms",
        "time": f"{report.sim_time_s:.0f} s simulated in {report.wall_time_s:.1f} s "
        f"({report.sim_time_s / max(report.wall_time_s, 1e-9):.0f} times real time)",
        "compilation": f"{report.compile_time_s:.1f} s (kept for the next run)",
        "seed": f"{report.seed}",
    }
    if report.following:
        rows["follows"] = report.following
    for key, value in rows.items():
        table.add_row(key, value)
    console.print(table)
