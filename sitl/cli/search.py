"""``rover-sitl campaign FILE --search GOAL``: looks for runs that go wrong, and writes each with the least it needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer
from rich.console import Console

from companion.cli.entry import StoppedError
from companion.cli.inputs import writable, written
from sitl.campaign.campaign_file import load_campaign
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests, RunStore
from sitl.campaign.workers import driven_here
from sitl.cli.runs import FILE, alone_in, check_all, number_of, progress, warm_up_all
from sitl.search.found_file import counted_from, differences, write_find
from sitl.search.goals import Goal
from sitl.search.minimise import minimised
from sitl.search.search import Find, first_bases, searched

MOST_MINIMISED = 20
"""Finds of one combination and rule are alike; the first of each are made as small as can be, at most so many."""


class _Driver:
    """Drives runs and keeps them, so that a search that was stopped goes on where it was."""

    def __init__(self, store: RunStore, digests: Digests, jobs: int) -> None:
        self._store, self._digests, self._jobs = store, digests, jobs

    def __call__(self, specs: Sequence[RunSpec]) -> list[RunResult]:
        left = list({spec.id: spec for spec in specs if spec.id not in self._store.results}.values())
        for spec, result in driven_here(left, self._digests, self._jobs if len(left) > 1 else 1):
            with written(self._store.file):
                self._store.add(spec, result)
        return [self._store.results[spec.id] for spec in specs]


def search_campaign(file: Path, goal: Goal, budget: int, out: Path | None, jobs: int) -> None:
    """All of it. Raises what a campaign raises."""
    table, folder, console = load_campaign(file), file.resolve().parent, Console()
    place = (out or Path("out") / table.name) / f"search-{goal}"
    writable(place / FILE)
    with alone_in(place):
        digests = Digests(folder)
        store = RunStore(place / FILE, digests.of)
        bases = first_bases(table)
        check_all(bases, folder)
        warm_up_all(bases, folder)
        drive, finds = _Driver(store, digests, jobs), list[Find]()
        before = len(store.results)
        try:
            with progress(console, budget) as advance:
                for found, driven in searched(table, goal, budget, drive):
                    finds += found
                    advance(driven)
            least = [minimised(find, drive) for find in _of_each_kind(finds)]
        except KeyboardInterrupt:
            kept = len(store.results) - before
            raise StoppedError(f"{number_of(kept, 'run')}, kept in {store.file}; the same command goes on") from None
        _put_out(least, finds, file, goal, place)


def _of_each_kind(finds: Sequence[Find]) -> list[Find]:
    """The first of each rule and combination."""
    kinds: dict[tuple[object, ...], Find] = {}
    for find in finds:
        base = find.base
        kinds.setdefault((find.rule, base.world, base.planner, base.controller, base.sensors, base.guard), find)
    return list(kinds.values())[:MOST_MINIMISED]


def _put_out(least: Sequence[Find], finds: Sequence[Find], file: Path, goal: Goal, place: Path) -> None:
    for find in least:
        result, folder = find.result, place / "found"
        spec = counted_from(find.spec, file, folder)
        target = folder / f"{find.rule}-{spec.id}.toml"
        with written(target):
            write_find(find, spec, target, f"rover-sitl campaign {file.name} --search {goal}")
        typer.echo(
            f"{find.rule}: {find.spec.world}, seed {spec.seed}, {result.led_by or spec.controller}: {result.outcome}, "
            f"touched {result.touched}, closest {result.clearance_m:g} m"
        )
        typer.echo(f"  differs: {differences(find)}")
        typer.echo(f"  again: rover-sitl campaign {target} --replay {spec.id} --record out/run")
    told = f"{number_of(len(finds), 'run')} went wrong, of {number_of(len(least), 'kind')}"
    typer.echo(told if finds else "no run went wrong")
