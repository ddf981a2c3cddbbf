"""What the commands that drive campaigns have in common: checks, warming up, progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from companion.executive.warm_up import COMPILING, kernels_warm, warm_up
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.drive_run import check_spec, mission_of, settings_of
from sitl.campaign.run_spec import RunSpec
from sitl.generators.made_ground import NoWayError

FILE = "runs.jsonl"
LINES = 10
"""Of progress, where there is no terminal for a bar."""


def number_of(count: int, what: str) -> str:
    """The number with its word, like ``1 run`` or ``2 runs``."""
    return f"{count} {what}{'' if count == 1 else 's'}"


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
def progress(console: Console, total: int) -> Iterator[Callable[[int], None]]:
    """A bar, or a few lines where there is no terminal; it is told how many more are done."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left:"), TimeRemainingColumn(),
    )  # fmt: skip
    done = told = 0
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("runs", total=total)

        def advance(more: int) -> None:
            nonlocal done, told
            done = min(done + more, total)
            progress.update(task, completed=done)
            if not console.is_terminal and LINES * done // total > told:
                told = LINES * done // total
                typer.echo(f"{done} of {total} runs", err=True)

        yield advance
