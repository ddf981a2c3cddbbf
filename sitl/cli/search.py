"""``rover-sitl campaign FILE --search GOAL``: looks for runs that go wrong, and writes each with the least it needs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import typer
from rich.console import Console

from companion.cli.entry import StoppedError
from companion.cli.inputs import writable, written
from sitl.campaign.campaign_file import CampaignError, CampaignTable, load_campaign
from sitl.campaign.page_parts import number_of
from sitl.campaign.replay_server import Replay, ReplayServer
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests, RunStore
from sitl.campaign.workers import driven_here
from sitl.cli.runs import FILE, alone_in, check_all, progress, say_what_there_is, warm_up_all
from sitl.cli.serve_report import replay_of, serve_report
from sitl.search.found_file import counted_from, differences, write_find
from sitl.search.genes import genes_of
from sitl.search.goals import Goal
from sitl.search.minimise import minimised
from sitl.search.search import Find, Generation, first_bases, searched
from sitl.search.search_report import KeptFind, SearchResult, write_evaluations, write_search_report

REPORT, CSV = "report.html", "evaluations.csv"
MOST_KEPT = 20
"""Finds of one rule and combination are alike: the first is made small and written. No more than so many are."""


class _Driver:
    """Drives runs and keeps them, so that a search that was stopped goes on where it was."""

    def __init__(self, store: RunStore, digests: Digests, jobs: int) -> None:
        self._store, self._digests, self._jobs = store, digests, jobs
        self.asked = 0
        """Runs that were asked for, also those that were kept before."""
        self.ended: Callable[[int], None] = lambda more: None
        """Called with 0 when a run has ended."""

    def __call__(self, specs: Sequence[RunSpec]) -> list[RunResult]:
        left = list({spec.id: spec for spec in specs if spec.id not in self._store.results}.values())
        for spec, result in driven_here(left, self._digests, self._jobs if len(left) > 1 else 1):
            with written(self._store.file):
                self._store.add(spec, result)
            self.ended(0)
        self.asked += len(specs)
        return [self._store.results[spec.id] for spec in specs]


class _Keeper:
    """Makes the first find of each rule and combination small, and writes it at once."""

    def __init__(self, file: Path, goal: Goal, place: Path, drive: _Driver) -> None:
        self._file, self._goal, self._place, self._drive = file, goal, place, drive
        self._kinds: set[tuple[str, str]] = set()
        self.found: list[Find] = []
        """Also those that were found while others were made small."""
        self.kept: list[KeptFind] = []

    def take(self, found: Sequence[Find]) -> None:
        """Finds of the search. What goes wrong besides while one is made small is one more."""
        waiting = deque(found)
        while waiting:
            find = waiting.popleft()
            self.found.append(find)
            kind = find.rule.value, replace(find.base, seed=0).id
            if kind not in self._kinds:
                self._kinds.add(kind)
                if len(self.kept) < MOST_KEPT:
                    waiting += self._keep(find)

    @property
    def left_out(self) -> int:
        """So many kinds were found when enough were made small."""
        return max(0, len(self._kinds) - MOST_KEPT)

    def sum_up(self) -> None:
        """The last line."""
        more = f"; no more than {MOST_KEPT} are made small, {self.left_out} were left out" if self.left_out else ""
        told = f"{number_of(len(self.found), 'find')} of {number_of(len(self._kinds), 'kind')}{more}"
        typer.echo(told if self.found else "no run went wrong")

    def _keep(self, find: Find) -> list[Find]:
        what = f"{find.rule}: {find.base.world}, seed {find.base.seed}"
        if find.values:
            typer.echo(f"{what}: driven again with less that differs", err=True)
        least, besides = minimised(
            find, self._goal, self._drive, lambda one: typer.echo(f"{what}: {differences(one)}", err=True)
        )
        result, folder = least.result, self._place / "found"
        spec = counted_from(least.spec, self._file, folder)
        target = folder / f"{least.rule}-{spec.id}.toml"
        with written(target):
            write_find(least, spec, target, f"rover-sitl campaign {self._file.name} --search {self._goal}")
        kept = KeptFind(least, spec, target)
        self.kept.append(kept)
        typer.echo(
            f"{least.rule}: {least.spec.world}, seed {spec.seed}, {result.led_by or spec.controller}: "
            f"{result.outcome}, touched {result.touched}, closest {result.clearance_m:g} m"
        )
        typer.echo(f"  differs: {differences(least)}")
        typer.echo(f"  again: {kept.command}")
        return besides


def place_of_search(table: CampaignTable, goal: Goal, out: Path | None) -> Path:
    """The folder of all that a search writes."""
    return (out or Path("out") / table.name) / f"search-{goal}"


def search_campaign(
    file: Path, goal: Goal, budget: int, out: Path | None, jobs: int, server: ReplayServer | None = None
) -> None:
    """All of it. Raises what a campaign raises."""
    table, folder, console = load_campaign(file), file.resolve().parent, Console()
    place = place_of_search(table, goal, out)
    writable(place / FILE)
    with alone_in(place):
        digests = Digests(folder)
        store = RunStore(place / FILE, digests.of)
        say_what_there_is(store, number_of(len(store.results), "run") if store.results else "")
        bases = first_bases(table)
        _check_moves(file, table, bases)
        check_all(bases, folder)
        warm_up_all(bases, folder)
        drive = _Driver(store, digests, jobs)
        keeper, before = _Keeper(file, goal, place, drive), len(store.results)
        generations: list[Generation] = []
        ended = _search(console, searched(table, goal, budget, drive), budget, drive, keeper, generations)
        driven = sum(len(one.evaluations) for one in generations)
        if driven:
            result = SearchResult(
                goal, budget, generations, keeper.kept, keeper.left_out, drive.asked - driven, ended,
                keeper.found, _command(file, goal, out),
            )  # fmt: skip
            _put_out(table, result, place)
        elif ended:
            raise CampaignError(
                f"{file}: search: no run could be driven, all that was tried contradicts itself; make bounds narrower"
            )
        if not ended:
            kept = len(store.results) - before
            raise StoppedError(f"{number_of(kept, 'run')}, kept in {store.file}; the same command goes on")
        keeper.sum_up()
    if server is not None:
        serve_report(server, place, _replays(result, digests))


def _replays(result: SearchResult, digests: Digests) -> Iterator[Replay]:
    """Of all finds, and of those that were made small."""
    for run_id, finds in result.wrong.items():
        yield replay_of(finds[0].spec, digests, (*result.command, "--replay", run_id))
    for kept in result.kept:
        yield replay_of(kept.spec, Digests(kept.file.parent), kept.replay)


def _check_moves(file: Path, table: CampaignTable, bases: Sequence[RunSpec]) -> None:
    """Raises CampaignError where a search has nothing to move."""
    for base in bases:
        if not genes_of(table, base):
            raise CampaignError(
                f"{file}: search.parts: {', '.join(table.search.parts)}: moves nothing in {base.world}, whose ground a "
                "file describes; name other parts, or leave this world out"
            )


def _command(file: Path, goal: Goal, out: Path | None) -> tuple[str, ...]:
    """Of the search, without what differs from time to time."""
    place = () if out is None else ("--out", str(out))
    return "campaign", str(file), "--search", goal.value, *place


def _search(
    console: Console,
    coming: Iterator[Generation],
    budget: int,
    drive: _Driver,
    keeper: _Keeper,
    generations: list[Generation],
) -> bool:
    """Take generations until there are no more, and append each; False: Ctrl-C has ended it."""
    try:
        with progress(console, budget) as advance:
            drive.ended = advance
            for generation in coming:
                generations.append(generation)
                advance(generation.cost)
                keeper.take(generation.finds)
    except KeyboardInterrupt:
        return False
    return True


def _put_out(table: CampaignTable, result: SearchResult, place: Path) -> None:
    """Report and table. Raises OutputError."""
    with written(place / REPORT):
        write_search_report(place / REPORT, table, result)
    with written(place / CSV):
        write_evaluations(place / CSV, result)
    typer.echo(f"report: {place / REPORT}")
