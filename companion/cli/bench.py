"""``rover-companion bench``: every planner and its installed peers on the same maps, in one run."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from companion.bench.cases import Case, map_case, paper_cases
from companion.bench.contestants import Contestant, our_planner
from companion.bench.measure import Entry, Limits, measure
from companion.bench.movingai import ScenarioFileError
from companion.bench.page import write_page
from companion.bench.peers import installed_peers
from companion.bench.report import as_json, head, rows, runs_explained
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, replaced, usable_settings, writable, written
from companion.cli.plan import PlaceError, place_of
from companion.core.clock import stopwatch_s
from companion.core.extras import not_installed
from companion.mapping.map_files import MapError, load_map
from companion.navigation.search_budget import budget_of
from companion.planning.registry import PLANNERS, UnknownPlannerError, warm_up
from companion.settings import Settings, SettingsError
from companion.storage.shipped import SOURCE, shipped

SIZES = "1,4,16,40"
NO_SIZES = "''"
"""How a shell is told an empty word."""
SAYS_S = 10.0


class BenchError(ValueError):
    """An option that cannot be used; the text is one line."""


def bench(
    map_files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MAP]...", help="Maps, with MovingAI scenario files beside them or --start, --target."),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(help="Sizes of the four shipped maps, times 100 x 50; default: 1,4,16,40; with MAPs none."),
    ] = None,
    planners: Annotated[str, typer.Option(help="Names, commas between them; default: all of ours.")] = "",
    peers: Annotated[bool, typer.Option(help="Other libraries too, those that are installed.")] = True,
    seeds: Annotated[int, typer.Option(min=1, help="Searches on each map of planners that draw random numbers.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="The first seed.")] = 0,
    problems: Annotated[int, typer.Option(min=1, help="Number of problems of each MAP's scenario file.")] = 20,
    start: Annotated[str | None, typer.Option(metavar="X,Y", help="Start on each MAP, instead of scenarios.")] = None,
    target: Annotated[str | None, typer.Option(metavar="X,Y", help="Target on each MAP.")] = None,
    cell_s: Annotated[float, typer.Option(min=0.1, help="Time limit in seconds for one planner on one map.")] = 10.0,
    maps: Annotated[Path | None, typer.Option(help="Folder with the four maps; default: missions/maps.")] = None,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures as JSON.")] = None,
    docs: Annotated[Path | None, typer.Option(help="Folder whose benchmarks.md and images/ are written.")] = None,
) -> None:
    """Compare planners on the four shipped maps, grown to several sizes, or on MAPs. Exit code 2: bad input.

    A row is made of --seeds searches if the planner draws random numbers, of 20 if not (its path is always the same),
    and of fewer where --cell-s is over; its column 'found' says how many searches gave a path, of how many.
    """
    console = Console()
    sizes = ("" if map_files else SIZES) if sizes is None else sizes
    try:
        settings = usable_settings(settings_file)
        writable(json_file)
        writable(docs and docs / "benchmarks.md")
        if not map_files and (start or target):
            raise BenchError("--start, --target: on which map? Name a MAP, as in bench yard.png --start 0,24 ...")
        cases = _cases(map_files or [], sizes, maps, lambda file: _of_map(file, problems, start, target))
        contestants = _contestants(planners, settings, console, peers=peers)
        limits = Limits(seeds, seed, cell_s)
        if not console.is_terminal:
            typer.echo("compiling, once on this machine, if that has not been done ...", err=True)
        with console.status("compiling (once a machine) ..."):
            warm_up()
        entries = _with_progress(contestants, cases, limits, console)
    except (
        SettingsError,
        MapError,
        ScenarioFileError,
        UnknownPlannerError,
        OutputError,
        BenchError,
        PlaceError,
    ) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    for table in _tables(entries, contestants, cases):
        console.print(table)
    console.print("\n" + " ".join(runs_explained(limits)).replace("*", "").replace("`", ""), highlight=False)
    command = _command(map_files or [], start, target, sizes, limits)
    try:
        if json_file is not None:
            with replaced(json_file) as new:
                figures = as_json(entries, cases, limits, settings)
                new.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
        if docs is not None:
            with written(docs):
                files = write_page(docs, command, entries, contestants, cases, limits)
            for file in files:
                console.print(f"written: {file}")
    except OutputError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error


def _of_map(file: Path, problems: int, start: str | None, target: str | None) -> Case:
    """The problems of one MAP. Raises MapError, ScenarioFileError, PlaceError, BenchError."""
    if start is None and target is None:
        return map_case(file, problems)
    if start is None or target is None:
        raise BenchError("--start and --target go together, as in --start 0,24 --target 98,24")
    grid = load_map(file)
    ends = place_of("--start", start, grid, False), place_of("--target", target, grid, False)
    return Case(file.stem, 1, grid.weights, (ends,))


def _cases(files: list[Path], sizes: str, maps: Path | None, of_map: Callable[[Path], Case]) -> list[Case]:
    try:
        scales = tuple(sorted({int(size) for size in sizes.split(",") if size}))
    except ValueError:
        raise BenchError(f"--sizes {sizes}: whole numbers with commas are needed, as in 1,4,16") from None
    if any(not 1 <= scale <= 100 for scale in scales):
        raise BenchError(f"--sizes {sizes}: from 1 to 100")
    folder = maps or (shipped() or SOURCE) / "maps"
    cases = paper_cases(folder, scales) if scales else []
    cases += [of_map(file) for file in files]
    if not cases:
        raise BenchError("nothing to measure: give --sizes or a MAP")
    return cases


def _command(files: list[Path], start: str | None, target: str | None, sizes: str, limits: Limits) -> str:
    """How to measure the same again."""
    maps = "".join(f"{file.name} " for file in files)
    ends = f"--start {start} --target {target} " if start else ""
    drawn = f"--seeds {limits.seeds} --seed {limits.first_seed} --cell-s {limits.cell_s:g}"
    return f"rover-companion bench {maps}{ends}--sizes {sizes or NO_SIZES} {drawn} --docs docs"


def _contestants(planners: str, settings: Settings, console: Console, *, peers: bool) -> list[Contestant]:
    names = [name.strip() for name in planners.split(",") if name.strip()] or list(PLANNERS)
    # As in the paper: stop at the first path, without further epochs that improve it.
    budget = replace(budget_of(settings.navigator.thorough), min_epochs=1)
    contestants = [our_planner(name, settings.planner, budget) for name in names]
    if peers:
        others, missing = installed_peers()
        contestants += others
        if missing:
            console.print(not_installed("--peers", "peers", *missing), markup=False)
    return contestants


def _with_progress(contestants: list[Contestant], cases: list[Case], limits: Limits, console: Console) -> list[Entry]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    told_s = stopwatch_s()
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=None)

        def advance(what: str, done: int, total: int) -> None:
            nonlocal told_s
            progress.update(task, description=what, completed=done, total=total)
            # Nobody sees a bar in a file or a pipe.
            if not console.is_terminal and done < total and stopwatch_s() - told_s >= SAYS_S:
                told_s = stopwatch_s()
                typer.echo(f"{done} of {total} measured, now {what} ...", err=True)

        return measure(contestants, cases, limits, advance)


def _tables(entries: list[Entry], contestants: list[Contestant], cases: list[Case]) -> list[Table]:
    tables = []
    for case in cases:
        title = f"{case.name} x{case.scale}: {case.weights.shape[1]} x {case.weights.shape[0]} fields"
        table = Table(title=title, title_justify="left", box=None, pad_edge=False)
        for column, name in enumerate(head([case.scale])[:-1]):
            table.add_column(name, justify="right" if column else "left", no_wrap=True)
        shown = [entry for entry in entries if (entry.case, entry.scale) == (case.name, case.scale)]
        for row in rows(shown, contestants, case.name, [case.scale]):
            table.add_row(*row[:-1])
        tables.append(table)
    return tables
