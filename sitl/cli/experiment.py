"""``rover-sitl experiment``: repeats a paper's experiment and shows the figures."""

from __future__ import annotations

import json
import os
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryFile

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, replaced, writable, written
from companion.mapping.map_files import MapError
from companion.settings import Settings
from companion.settings.versions import made_with
from sitl.cli import experiment_options as given
from sitl.cli.extras import statistics_fault
from sitl.experiments.experiment import (
    OFF_MODEL,
    TIMEOUT_S,
    Checked,
    Experiment,
    ExperimentError,
    ExperimentReport,
    Options,
    unknown,
)

WITH_STATISTICS = ("barn", "gates", "killed-companion", "traffic", "wang-table4")
EXIT_FAILED = 3
WIDTH = 200
"""Of the output where there is no terminal: no table is wider."""
LINES = 10
"""Of progress, where there is no terminal for a bar."""


def experiment(
    name: given.Name,
    runs: given.Runs = None,
    seed: given.Seed = 0,
    jobs: given.Jobs = 1,
    maps: given.Maps = None,
    world: given.World = None,
    planners: given.Planners = None,
    worlds: given.Worlds = None,
    controllers: given.Controllers = None,
    setups: given.Setups = None,
    lidar: given.Lidar = None,
    missions: given.Missions = None,
    sensors: given.Sensors = None,
    guard: given.Guard = False,
    off: given.Off = OFF_MODEL,
    late: given.Late = 0.0,
    guid_timeout: given.GuidTimeout = TIMEOUT_S,
    outline: given.Outline = None,
    turning_radius: given.TurningRadius = 0.0,
    keep: given.Keep = None,
    json_file: given.JsonFile = None,
    docs: given.Docs = None,
) -> None:
    """Run the experiment NAME and print its tables.

    Exit code 2: bad input; 3: soak: a collision, an error, growing memory; dead-companion, killed-companion: a contact.
    """
    console = _console()
    try:
        _check(name, json_file, docs)
        runs = runs or (given.RUNS_OF_BARN if name == "barn" else given.RUNS)
        options = Options(
            runs, seed, jobs, maps, tuple(world or ()), given.names_given("--planners", planners), worlds,
            given.names_given("--controllers", controllers), given.names_given("--setups", setups), lidar, guard, off,
            late, guid_timeout, keep, given.names_given("--missions", missions),
            given.names_given("--sensors", sensors), given.outline_m(outline), turning_radius,
        )  # fmt: skip
        given.refuse_unused(name, options)
        _check_keep(keep)
        report = _with_progress(name, options, console)
        _put_out(report, console, json_file, docs)
    except (ExperimentError, MapError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    except KeyboardInterrupt:
        if keep is not None:
            typer.echo(f"what is done is kept in {keep}; the same command goes on", err=True)
        raise
    if isinstance(report, Checked) and report.failure:
        typer.echo(f"experiment {name}: {report.failure}", err=True)
        raise typer.Exit(EXIT_FAILED)


def _console() -> Console:
    """Into a file or pipe tables are whole: rich would take 80 columns there, and cut the headings."""
    console = Console()
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = WIDTH
    return console


def _check(name: str, json_file: Path | None, docs: Path | None) -> None:
    """Before the work, not after it: a name, a library or a place that is not there."""
    if name not in given.EXPERIMENTS:
        raise unknown("experiment", name, given.EXPERIMENTS)
    if name in WITH_STATISTICS and (fault := statistics_fault(f"experiment {name}")):
        raise ExperimentError(fault)
    writable(json_file)
    writable(docs and docs / "results.md")


def _check_keep(keep: Path | None) -> None:
    """Make the folder and try to write into it. Raises OutputError."""
    if keep is None:
        return
    try:
        keep.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=keep):
            pass
    except OSError as error:
        raise OutputError(
            f"--keep {keep}: cannot be written: {error.strerror or error}; name a folder that can be made"
        ) from error


def _with_progress(name: str, options: Options, console: Console) -> ExperimentReport:
    run: Experiment = import_module(f"sitl.experiments.{name.replace('-', '_')}").run
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        # The bar appears with the first progress, so that a bad folder of maps gives one line only.
        task = progress.add_task(name, total=None, visible=False)

        told = 0

        def advance(done: int, total: int) -> None:
            nonlocal told
            progress.update(task, completed=done, total=total, visible=True)
            if not console.is_terminal and LINES * done // total > told:
                told = LINES * done // total
                typer.echo(f"{name}: {done} of {total}", err=True)

        return run(options, advance)


def _put_out(report: ExperimentReport, console: Console, json_file: Path | None, docs: Path | None) -> None:
    for table in report.tables():
        console.print(table)
    if json_file is not None:
        text = json.dumps({**made_with(Settings()), **report.as_json()}, indent=2) + "\n"
        with replaced(json_file) as new:
            new.write_text(text, encoding="utf-8")
        typer.echo(f"figures: {json_file}")
    if docs is not None:
        with written(docs):
            files = report.write_docs(docs)
        for file in files:
            typer.echo(f"written: {file}")
