"""A replay for someone who waits at a terminal: with a line that shows how far it is."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from companion.app import Companion
from companion.recording.reader import Record
from companion.recording.record_clock import record_clock
from companion.replay.replay import Observers, ReplayObserver, ReplayResult, replay

STEP_S = 1.0
"""Of the record: the line is drawn anew after so much."""


class _Shown(ReplayObserver):
    """Draws the line."""

    def __init__(self, progress: Progress, record: Record) -> None:
        self._progress = progress
        self._task = progress.add_task(f"replaying {record.directory.name}", total=record_clock(record).length_s)
        self._next_s = 0.0

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        if time_s >= self._next_s:
            self._next_s = time_s + STEP_S
            self._progress.update(self._task, completed=time_s)


def watched_replay(record: Record, *observers: ReplayObserver) -> ReplayResult:
    """As ``replay``, for these observers. Where errors go to a terminal, a line there shows how far it is."""
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        return replay(record, Observers([*observers, _Shown(progress, record)]))
