"""``rover-sitl experiment``: repeats a paper's experiment and shows the figures."""

from __future__ import annotations

import json
import math
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, replaced, writable, written
from companion.mapping.map_files import MapError
from companion.settings import Settings
from companion.settings.versions import made_with
from sitl.cli.extras import statistics_fault
from sitl.cli.named import names_in
from sitl.experiments.experiment import OFF_MODEL, Checked, Experiment, ExperimentError, ExperimentReport, Options

EXPERIMENTS = (
    "adaptive-control-points",
    "kwasniewski-maps",
    "kwasniewski-table1",
    "navigation",
    "driving",
    "dead-companion",
    "killed-companion",
    "missions",
    "barn",
    "controllers",
    "traffic",
    "gates",
    "wang-table4",
    "sedighi-table1",
    "achour-table1",
    "soak",
)
"""Each is a module of ``sitl.experiments``, loaded when it is asked for: they load the plotting library."""
ON_ANY_MAP = ("navigation", "driving")
OWN_ENVIRONMENTS = ("wang-table4", "achour-table1")
WITH_CONTROLLERS = ("barn", "controllers", "dead-companion", "gates", "killed-companion", "missions")
WITH_MISMATCH = ("barn", "controllers", "dead-companion", "gates", "killed-companion", "missions")
WITH_LATE = ("barn", "controllers", "gates", "killed-companion", "missions")
DRIVES = ("barn", "controllers", "dead-companion", "driving", "gates", "killed-companion", "missions", "traffic")
WITH_STATISTICS = ("barn", "gates", "killed-companion", "traffic", "wang-table4")
WITH_GUARD = ("dead-companion", "killed-companion", "missions")
RUNS, RUNS_OF_BARN = 100, 10
"""Unless it is said; the second as the BARN challenge has it."""
EXIT_FAILED = 3
LINES = 10
"""Of progress, where there is no terminal for a bar."""


def experiment(
    name: Annotated[str, typer.Argument(metavar="NAME", help=f"One of: {', '.join(EXPERIMENTS)}.")],
    runs: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Runs, with consecutive seeds, on each map, mission or world; default: "
            f"{RUNS}, for barn {RUNS_OF_BARN}. kwasniewski-table1 makes at least 3.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the first run; the next ones are consecutive.")] = 0,
    jobs: Annotated[
        int, typer.Option(min=1, help="Processes (needs joblib). Results stay the same, but measured times get longer.")
    ] = 1,
    maps: Annotated[
        Path | None, typer.Option(help="Folder with the maps; default: missions/maps. sedighi-table1: more grids.")
    ] = None,
    world: Annotated[
        list[Path] | None,
        typer.Option(
            help="navigation, driving: another map, with its MovingAI scenario file beside it; may be repeated."
        ),
    ] = None,
    planners: Annotated[
        str, typer.Option(help="navigation, driving: names, separated by commas; default: all that apply.")
    ] = "",
    worlds: Annotated[
        Path | None,
        typer.Option(
            help="barn: a file of BARN worlds (.npz; docs/worlds.md says how it is made). Driven is the challenge's "
            "standard set of 50 worlds, or every world of a file that lacks some of them. Default: 50 worlds of our "
            "own making."
        ),
    ] = None,
    controllers: Annotated[
        str,
        typer.Option(
            help=f"{', '.join(WITH_CONTROLLERS)}: what leads the rover, names separated by commas; default: all, for "
            "gates motion-ga, for dead-companion, killed-companion and missions points."
        ),
    ] = "",
    setups: Annotated[
        str,
        typer.Option(
            help="barn: guarded, strict (without the guard), jackal (a Jackal's limits), separated by commas; gates: "
            "one of the first two; default: guarded."
        ),
    ] = "",
    missions: Annotated[
        str,
        typer.Option(help="dead-companion, missions: names of shipped missions, separated by commas; default: all."),
    ] = "",
    guard: Annotated[
        bool,
        typer.Option("--guard", help="dead-companion, killed-companion, missions: with the guard on the autopilot."),
    ] = False,
    off: Annotated[
        float,
        typer.Option(
            min=0.0, max=0.9, help=f"{', '.join(WITH_MISMATCH)}: so far the rover is off its model, at most: a share."
        ),
    ] = OFF_MODEL,
    late: Annotated[
        float,
        typer.Option(
            min=0.0, max=2.0, help=f"{', '.join(WITH_LATE)}: seconds that a message takes over the link, each way."
        ),
    ] = 0.0,
    outline: Annotated[
        str,
        typer.Option(
            metavar="LENGTHxWIDTH",
            help="gates: the rover's outline in metres, 2.0x0.5 for example; default: 0.9x0.7.",
        ),
    ] = "",
    turning_radius: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=10.0,
            help="driving: the random grounds alone, with steered wheels whose tightest arc has this radius in metres.",
        ),
    ] = 0.0,
    keep: Annotated[
        Path | None,
        typer.Option(
            help=f"{', '.join(DRIVES)}: a folder that keeps each result (needs joblib). After an end before the time, "
            "the same command goes on. Results of other code are not used."
        ),
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures as JSON.")] = None,
    docs: Annotated[
        Path | None,
        typer.Option(help="Folder whose results.md and images/ are updated; created if missing."),
    ] = None,
) -> None:
    """Run the experiment NAME and print its tables.

    Exit code 2: bad input; 3: soak: a collision, an error, growing memory; dead-companion, killed-companion: a contact.
    """
    console = Console()
    try:
        if name not in EXPERIMENTS:
            raise ExperimentError(f"experiment {name}: unknown; known are {', '.join(EXPERIMENTS)}")
        if name in WITH_STATISTICS and (fault := statistics_fault(f"experiment {name}")):
            raise ExperimentError(fault)
        # Report a file that cannot be written before the work, not after it.
        writable(json_file)
        writable(docs and docs / "results.md")
        for option, listed in (("--planners", planners), ("--controllers", controllers), ("--missions", missions)):
            if listed and not names_in(listed):
                raise ExperimentError(f"{option} {listed!r:.40}: names nothing; separate names by commas")
        _refuse_unused(name, planners=planners, world=world, maps=maps)
        runs = runs or (RUNS_OF_BARN if name == "barn" else RUNS)
        options = Options(
            runs, seed, jobs, maps, tuple(world or ()), names_in(planners), worlds, names_in(controllers),
            names_in(setups), guard, off, late, keep, names_in(missions), _outline_m(outline), turning_radius,
        )  # fmt: skip
        _refuse_unused_motion(name, options)
        report = _with_progress(name, options, console)
        _put_out(report, console, json_file, docs)
        if isinstance(report, Checked) and report.failure:
            typer.echo(f"experiment {name}: {report.failure}", err=True)
            raise typer.Exit(EXIT_FAILED)
    except (ExperimentError, MapError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error


def _outline_m(given: str) -> tuple[float, float] | None:
    """Length and width in metres. Raises ExperimentError."""
    if not given:
        return None
    try:
        length_m, width_m = (float(one) for one in given.split("x"))
    except ValueError:
        length_m = width_m = math.nan
    if not 0.1 <= width_m <= length_m <= 5.0:
        raise ExperimentError(
            f"--outline {given!r:.40}: give length and width in metres, 0.1 to 5, the length first: 2.0x0.5"
        )
    return length_m, width_m


def _refuse_unused(name: str, *, planners: str, world: list[Path] | None, maps: Path | None) -> None:
    """Refuse options without effect. Raises ExperimentError."""
    if name not in ON_ANY_MAP:
        if planners:
            raise ExperimentError(f"--planners: {name} does not take it; the option is for navigation and driving")
        if world:
            raise ExperimentError(f"--world: {name} has its own maps; the option is for navigation and driving")
    if maps is not None and name in OWN_ENVIRONMENTS:
        raise ExperimentError(f"--maps: {name} draws the paper's own environments, it reads no maps")


def _refuse_unused_motion(name: str, options: Options) -> None:
    """The same, of the options about motion. Raises ExperimentError."""
    if options.archive and name != "barn":
        raise ExperimentError(f"--worlds: {name} does not take it; the option is for barn")
    if options.outline_m is not None and name != "gates":
        raise ExperimentError(f"--outline: {name} does not take it; the option is for gates")
    if options.turning_radius_m and name != "driving":
        raise ExperimentError(f"--turning-radius: {name} does not take it; the option is for driving")
    if options.turning_radius_m and options.worlds:
        raise ExperimentError("--turning-radius: with it the random grounds alone are driven; leave out --world")
    if options.setups and name not in ("barn", "gates"):
        raise ExperimentError(f"--setups: {name} does not take it; the option is for barn and gates")
    for option, is_given, takers in (
        ("--controllers", bool(options.controllers), WITH_CONTROLLERS),
        ("--guard", options.guard, WITH_GUARD),
        ("--off", options.off != OFF_MODEL, WITH_MISMATCH),
        ("--late", options.late_s > 0.0, WITH_LATE),
        ("--keep", options.keep is not None, DRIVES),
        ("--missions", bool(options.missions), ("dead-companion", "missions")),
    ):
        if is_given and name not in takers:
            listed = " and ".join(filter(None, (", ".join(takers[:-1]), takers[-1])))
            raise ExperimentError(f"{option}: {name} does not take it; the option is for {listed}")


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
