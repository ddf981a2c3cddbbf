"""Pace and progress of ``drive`` without a view: the state of the run, and every text of the companion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from companion.app import Status
from companion.core.clock import Clock
from companion.safety.reasons import EndReason, Reason
from sitl.lockstep import TRACK_PERIOD_S, Drive, Report

LINE_EVERY_S = 60.0
NOBODY_S = 60.0
"""Nobody is there to do what a companion waits for: after so long the run is ended."""
BEGINS_S = 300.0
"""A simulated rover that cannot begin until then never will: its EKF takes 45 s."""


class Pace:
    """Limits simulated time to ``speedup`` times real time (None: as fast as possible), counted from the first call."""

    def __init__(self, speedup: float | None, clock: Clock) -> None:
        self._speedup = speedup
        self._clock = clock
        self._began: tuple[float, float] | None = None

    def wait(self, time_s: float) -> None:
        """Wait until the simulated ``time_s`` may be passed; return at once if it is late already."""
        if self._speedup is None:
            return
        began_s, first_s = self._began = self._began or (self._clock.now_s(), time_s)
        self._clock.sleep_until_s(began_s + (time_s - first_s) / self._speedup)


@dataclass(frozen=True, slots=True)
class Also:
    """What else looks at the run, and how often, in simulated time."""

    show: Callable[[Status], None] = lambda status: None
    every_s: float = TRACK_PERIOD_S


class Unattended:
    """Ends a run that waits for a person: in lock-step there is none but those of a plan of faults, or at a page.

    Also one that does not begin, because data that it needs never comes.
    """

    def __init__(self, run: Drive, say: Callable[[str], None]) -> None:
        self._run = run
        self._say = say
        self._since_s: float | None = None
        self._ended = False

    def look(self, status: Status) -> None:
        """To be called often."""
        if self._run.companion.executor is None and status.time_s >= BEGINS_S and self._run.station is None:
            self._end(status, Reason(EndReason.NEVER_BEGINS, (status.doing,)))
        if not status.activity.needs_person or self._run.station is not None:
            self._since_s = None
            return
        self._since_s = status.time_s if self._since_s is None else self._since_s
        if status.time_s - self._since_s >= NOBODY_S:
            self._end(status, Reason(EndReason.NOBODY_HERE))

    def _end(self, status: Status, why: Reason[EndReason]) -> None:
        if not self._ended:
            self._ended = True
            doing = f" ({status.doing})" if why.kind is EndReason.NOBODY_HERE else ""
            self._say(f"{status.time_s:6.1f} s  ended: {why}{doing}")
            self._run.companion.stop(why.kind)


class Telling:
    """Prints the companion's texts as they come, and collisions."""

    def __init__(self, run: Drive, console: Console) -> None:
        self._name = run.mission.name
        self._console = console
        self._run = run
        self._collisions = 0

    def tell(self, status: Status) -> None:
        """Those said since the last call, and collisions."""
        collisions = self._run.simulator.collisions
        for number, collision in enumerate(collisions[self._collisions :], self._collisions + 1):
            told = collision.told(self._run.scenario.start)
            self.line(f"{collision.time_s:6.1f} s  collision {number}: {told}", style="bold red")
        self._collisions = len(collisions)
        for news in status.news:
            if news.own:
                self.line(f"{status.time_s:6.1f} s  {news.text}")

    def line(self, text: str, style: str | None = None) -> None:
        """One line of this run."""
        self._console.print(f"{self._name}: {text}", style=style, soft_wrap=True, markup=False, highlight=False)


def run_with_progress(run: Drive, console: Console, pace: Pace, also: Also = Also()) -> Report:
    """Drive to the end, with one changing line; without a terminal (a log file, CI) with lines now and then."""
    if not console.is_terminal:
        return _run_with_lines(run, console, pace, also)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(run.mission.name, total=None, state="")
        telling = Telling(run, progress.console)
        unattended = Unattended(run, telling.line)

        def observe(status: Status) -> None:
            telling.tell(status)
            progress.update(task, state=_state(run, status))
            unattended.look(status)
            also.show(status)
            pace.wait(status.time_s)

        report = run.run(observe, also.every_s)
        last = run.take_status()
        telling.tell(last)
        also.show(last)
        progress.update(task, total=1, completed=1, state=report.outcome)
    return report


def _run_with_lines(run: Drive, console: Console, pace: Pace, also: Also) -> Report:
    telling, next_s = Telling(run, console), 0.0
    unattended = Unattended(run, telling.line)

    def observe(status: Status) -> None:
        nonlocal next_s
        telling.tell(status)
        if status.time_s >= next_s:
            next_s = status.time_s + LINE_EVERY_S
            telling.line(_state(run, status))
        unattended.look(status)
        also.show(status)
        pace.wait(status.time_s)

    report = run.run(observe, also.every_s)
    last = run.take_status()
    telling.tell(last)
    also.show(last)
    return report


def _state(run: Drive, status: Status) -> str:
    part = status.decision.part.value if status.decision else "-"
    state = f"{status.time_s:6.1f} s  {status.doing}  {status.target}  part {part}  step {status.steps}"
    goal = run.companion.progress.goal if run.companion.progress else None
    if goal is not None and status.pose is not None:
        state += f"  {status.pose.point.distance_m(goal.point):.0f} m straight"
    return state
