"""``rover-companion compile``: compiles the kernels of a run beforehand, in a process for each processor."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from companion.cli import kernel_cache
from companion.cli.inputs import EXIT_BAD_INPUT, usable_settings
from companion.core.clock import stopwatch_s
from companion.settings import Settings, SettingsError

Job = Callable[[], None]
CONTROLLERS = ("motion-ga", "dwa", "mppi")
A_RADIUS_M = 1.0
"""Any turning radius: the kernels are the same."""


def compile_kernels(
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes side by side; default: one a processor.")] = None,
) -> None:
    """Compile what a run needs, once on this machine, so that the first run begins at once.

    With --settings, for a run with those. Exit code 2: bad input, or not enough memory.
    """
    try:
        settings = usable_settings(settings_file)
    except SettingsError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if is_compiled(settings):
        typer.echo(f"nothing to do: the kernels are in {os.environ[kernel_cache.PLACE]}")
        return
    wanted = [genetic_planner, graph_searches, drive, manoeuvres]
    wanted += [] if settings == Settings() else [Chosen(settings)]
    since_s = stopwatch_s()
    try:
        _show(Console(), wanted, jobs)
    except BrokenProcessPool as error:
        typer.echo("a process of the compiler was ended, perhaps for want of memory; try --jobs 1", err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(f"compiled in {stopwatch_s() - since_s:.0f} s; the kernels are in {os.environ[kernel_cache.PLACE]}")


def _show(console: Console, wanted: Sequence[Job], processes: int | None) -> None:
    """Run all jobs, with one line that shows how far they are; where nobody looks, with a line for each."""
    if not console.is_terminal:
        for line in lines_of(wanted, AFTER, processes):
            typer.echo(line)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("compiling, once on this machine", total=len(wanted))
        for job in done_one_by_one(wanted, AFTER, processes):
            progress.update(task, advance=1, description=f"compiled: {name_of(job)}")


def is_compiled(settings: Settings) -> bool:
    """Whether a run with these settings, of any rover, has nothing to compile."""
    from companion.executive.warm_up import kernels_warm

    return kernels_warm(settings, A_RADIUS_M)


def genetic_planner() -> None:
    """The B-spline planner: half of the time."""
    _planners("bspline-ga")


def graph_searches() -> None:
    """The planners that the default planner falls back to."""
    _planners("astar", "theta-star")


def drive() -> None:
    """Maps, guidance and the viewer's tiles, and what combines the planners."""
    from companion.executive.warm_up import warm_up
    from companion.viewer import map_tiles

    warm_up(Settings())
    map_tiles.warm_up()


def manoeuvres() -> None:
    """Guidance of rovers that cannot turn on the spot."""
    from companion.executive.warm_up import warm_up

    warm_up(Settings(), turning_radius_m=A_RADIUS_M)


def motions() -> None:
    """Guidance that plans motions."""
    from companion.executive.warm_up import warm_up

    for kind in CONTROLLERS:
        warm_up(Settings.model_validate({"guidance": {"controller": kind}}))


class Chosen:
    """What a run with these settings needs beside the default."""

    __name__ = "what these settings choose"

    def __init__(self, settings: Settings) -> None:
        self._settings = settings

    def __call__(self) -> None:
        """Compile it."""
        from companion.executive.warm_up import warm_up

        warm_up(self._settings, A_RADIUS_M)


AFTER: Mapping[Job, Sequence[Job]] = {drive: (genetic_planner, graph_searches), manoeuvres: (drive,), motions: (drive,)}
"""Jobs that use the kernels of others. Side by side, both would compile them."""


def done_one_by_one(
    jobs: Sequence[Job], after: Mapping[Job, Sequence[Job]], processes: int | None = None
) -> Iterator[Job]:
    """Run all jobs, in a process for each processor; yields each when it is done. ``Chosen`` follows all others.

    Of those that need not wait, the first in the list begins first.

    Raises BrokenProcessPool when the system has ended one of the processes. Whoever asks for no more ends them.
    """
    waiting, done = list(jobs), set[Job]()
    running: dict[Future[None], Job] = {}
    side_by_side = processes or os.cpu_count() or 1
    with ProcessPoolExecutor(side_by_side, get_context("spawn")) as pool, _ended_with_us():
        while waiting or running:
            ready = [job for job in waiting if done.issuperset(_before(job, jobs, after))]
            # No more than there are processes: the pool begins them in the order in which it was given them.
            for job in ready[: side_by_side - len(running)]:
                waiting.remove(job)
                with _ctrl_c_waits():  # this starts a process if none is idle
                    running[pool.submit(job)] = job
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                future.result()
                job = running.pop(future)
                done.add(job)
                yield job


def lines_of(jobs: Sequence[Job], after: Mapping[Job, Sequence[Job]], processes: int | None = None) -> Iterator[str]:
    """Run all jobs; a line for each that is done."""
    since_s = stopwatch_s()
    for count, job in enumerate(done_one_by_one(jobs, after, processes), 1):
        yield f"  compiled {count} of {len(jobs)}: {name_of(job)} ({stopwatch_s() - since_s:.0f} s)"


def name_of(job: Job) -> str:
    """The job in words."""
    return job.__name__.replace("_", " ")


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Ctrl-C comes after this block. A process started in it never hears it, not even while it imports: it would
    say so with a traceback of its own."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _ended_with_us() -> Iterator[None]:
    """End the processes started in this block if it is left early: the pool would wait until their jobs are done."""
    others = set(active_children())
    try:
        yield
    except BaseException:
        for process in set(active_children()) - others:
            process.terminate()
        raise


def _before(job: Job, jobs: Sequence[Job], after: Mapping[Job, Sequence[Job]]) -> Sequence[Job]:
    if isinstance(job, Chosen):
        return [one for one in jobs if one is not job]
    return [one for one in after.get(job, ()) if one in jobs]


def _planners(*names: str) -> None:
    from companion.planning import registry

    registry.warm_up(names)
