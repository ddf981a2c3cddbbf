"""Output of a run while it drives: one changing line on a terminal, lines with levels for log files and systemd."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from types import TracebackType
from typing import TextIO, cast

from rich.console import Console
from rich.markup import escape
from rich.status import Status as Spinner

from companion.app import Status
from companion.core.severity import Severity
from companion.storage.background_writer import BackgroundWorker, ShutdownBudget
from companion.storage.unbuffered import UnbufferedOutput, let_go, shared_with

STDOUT, STDERR = 1, 2

LEVELS = {Severity.WARNING: "warning", Severity.NOTICE: "notice", Severity.INFO: "info", Severity.DEBUG: "debug"}
"""Words for log files; all that is worse is an error."""


class Reader(Enum):
    """What reads the output."""

    PERSON = "terminal"
    LOG = "file or pipe"
    JOURNAL = "journal"


def reader_of(descriptor: int, environment: Mapping[str, str]) -> Reader:
    """What reads a descriptor. systemd names its journal's stream in ``JOURNAL_STREAM``, by device and inode."""
    try:
        status = os.fstat(descriptor)
    except OSError:
        return Reader.LOG
    if environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}":
        return Reader.JOURNAL
    return Reader.PERSON if os.isatty(descriptor) else Reader.LOG


def levelled(text: str, severity: Severity, reader: Reader) -> str:
    """The line: ``<4>text`` for the journal, ``warning: text`` in a log, the text alone for a person."""
    match reader:
        case Reader.JOURNAL:
            return f"<{severity.value}>{text}"
        case Reader.LOG:
            return f"{LEVELS.get(severity, 'error')}: {text}"
        case _:
            return text


UPDATE_S = 0.25
MOST_WAITING = 200
"""So many outputs wait for a slow reader; more are left out."""


class LiveConsole(Console):
    """Standard error, which may lose its reader."""

    def on_broken_pipe(self) -> None:
        """Called when the reader has gone. rich would end the program; here the rover drives on."""
        self.quiet = True
        let_go([self.file.fileno()])


def error_console() -> LiveConsole:
    """A console on standard error that shares no buffer with others, where that is possible."""
    try:
        descriptor = sys.stderr.fileno()
    except (OSError, ValueError):  # something else stands in for it
        return LiveConsole(stderr=True)
    return LiveConsole(file=cast(TextIO, UnbufferedOutput(descriptor)))


class Live:
    """A context manager that shows the companion's status; call ``show`` after every tick.

    A thread prints: a reader that takes nothing (Ctrl-S, an ssh that hangs) does not hold up the drive.
    """

    def __init__(self, console: Console, name: str, reader: Reader = Reader.PERSON) -> None:
        self._console = console
        self._reader = reader
        self._name = name
        self._spinner = Spinner("connecting", console=console, refresh_per_second=4.0) if console.is_terminal else None
        self._shown = ""
        self._updated_s = -UPDATE_S
        self._broken = False
        self._budget = ShutdownBudget()
        self._worker = BackgroundWorker("lines", self._budget)
        self._put = self._done = self._left_out = 0
        self._streams = (sys.stdout, sys.stderr)

    def unhurried(self, seconds: float) -> None:
        """The end may wait so much longer for the reader."""
        self._budget.extend(seconds)

    def __enter__(self) -> Live:
        """Start the changing line."""
        if self._spinner is not None:
            self._later(self._spinner.start)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal. If nobody reads it any more, what is still said is dropped: no one waits for it."""
        if self._spinner is not None:
            self._put_now(self._spinner.stop, 0)
        if not self._worker.close():
            sys.stdout, sys.stderr = self._streams  # the changing line had taken their places
            let_go(shared_with(STDERR, (STDOUT,)))

    def show(self, status: Status) -> None:
        """Show what is new; never waits. A lost terminal or a full disk does not end the run."""
        for news in status.news:
            self.tell(news.text, news.severity)
        if self._spinner is None:
            line = f"{status.doing}{f': {status.target}' if status.target else ''}"
            if line != self._shown:
                self._shown = line
                self.tell(line, Severity.INFO)
        elif status.time_s - self._updated_s >= UPDATE_S:
            self._updated_s = status.time_s
            self._later(partial(self._spinner.update, _line(status)))

    def tell(self, text: str, severity: Severity) -> None:
        """One line; never waits."""
        self._later(partial(self._print, text, severity))

    def _later(self, act: Callable[[], None]) -> None:
        """To be done in the thread, unless too much waits already."""
        if self._put - self._done >= MOST_WAITING:
            self._left_out += 1
            return
        left_out, self._left_out = self._left_out, 0
        self._put_now(act, left_out)

    def _put_now(self, act: Callable[[], None], left_out: int) -> None:
        self._put += 1
        self._worker.put(partial(self._do, act, left_out))

    def _do(self, act: Callable[[], None], left_out: int) -> None:
        try:
            if left_out and not self._broken:
                self._print(f"{left_out} outputs left out: nobody read them", Severity.WARNING)
            if not self._broken:
                act()
        except Exception:  # a line is not worth a stop
            self._broken = True
        self._done += 1

    def _print(self, text: str, severity: Severity) -> None:
        line = levelled(f"{self._name}: {text}", severity, self._reader)
        self._console.print(line, soft_wrap=True, markup=False, highlight=False)


def _line(status: Status) -> str:
    columns = [f"{status.doing}"]
    if status.target:
        columns.append(escape(f"{status.target} [{status.targets_reached}/{status.targets}]"))
    if status.pose is not None:
        columns.append(f"north {status.pose.north_m:.1f} m, east {status.pose.east_m:.1f} m")
    if status.decision is not None:
        columns.append(f"part {status.decision.part}")
    return "  ".join([*columns, f"steps {status.steps}"])
