"""What the commands that drive campaigns have in common: checks, warming up, progress."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from companion.cli.patience import Patience
from companion.executive.warm_up import COMPILING, kernels_warm, warm_up
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.drive_run import check_spec, mission_of, settings_of
from sitl.campaign.page_parts import number_of
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.run_store import RunStore
from sitl.generators.made_ground import NoWayError

FILE = "runs.jsonl"
LINES = 10
"""Of progress, where there is no terminal for a bar."""
QUIET_S = 120.0
"""After so long without a run that ends it is told: a planner of one's own may never come back."""
QUIET = f"no run has ended for {QUIET_S:.0f} s: a long one, or a planner or controller that never answers"


def say_what_there_is(store: RunStore, done: str) -> None:
    """One line of what was kept before, and what of it does not count. ``done``: in words, empty for nothing."""
    parts = [f"{done} {'is' if done == '1 run' else 'are'} there"] if done else []
    parts += [f"{number_of(store.torn, 'torn line')} left out"] if store.torn else []
    parts += [f"{number_of(store.older, 'line')} of other code or files left out"] if store.older else []
    if parts:
        _tell(f"{store.file}: {', '.join(parts)}")


def check_all(left: list[RunSpec], folder: Path) -> None:
    """What could not be driven at all is told before hours of driving. Raises one of ``BAD_INPUT``."""
    for spec in {(spec.world, spec.sensors, spec.faults): spec for spec in left}.values():
        try:
            check_spec(spec, folder)
        except NoWayError as error:
            raise CampaignError(f"worlds: {spec.world!r:.120}, seed {spec.seed}: {error}") from error


def warm_up_all(left: list[RunSpec], folder: Path) -> None:
    """Once, before several processes would each compile for themselves."""
    kinds = {(spec.planner, spec.controller, spec.settings, spec.world): spec for spec in left}
    for spec in kinds.values():
        settings, radius_m = settings_of(spec), mission_of(spec, folder).rover.turning_radius_m
        if not kernels_warm(settings, radius_m):
            typer.echo(COMPILING, err=True)
            warm_up(settings, radius_m)


@contextmanager
def alone_in(folder: Path, otherwise: str = "another campaign writes its runs here") -> Iterator[None]:
    """Nobody else works in this folder meanwhile. Raises CampaignError, with who it is ``otherwise``."""
    held = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        text = f"{folder}: {otherwise}; wait for its end, or choose another folder with --out"
        raise CampaignError(text) from None
    finally:
        os.close(held)


@contextmanager
def progress(console: Console, total: int, before: int = 0) -> Iterator[Callable[[int], None]]:
    """A bar, or a few lines where there is no terminal; it is told how many more are done. ``before``: already."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left:"), TimeRemainingColumn(),
    )  # fmt: skip
    done, told = before, LINES * before // total
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("runs", total=total, completed=before)
        patience = Patience(QUIET_S, lambda: progress.console.print(QUIET) if console.is_terminal else _tell(QUIET))
        patience.begin()

        def advance(more: int) -> None:
            nonlocal done, told
            done = min(done + more, total)
            patience.begin()
            progress.update(task, completed=done)
            if not console.is_terminal and LINES * done // total > told:
                told = LINES * done // total
                _tell(f"{done} of {total} runs")

        try:
            yield advance
        finally:
            patience.end()


def _tell(text: str) -> None:
    typer.echo(text, err=True)
