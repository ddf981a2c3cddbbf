"""Output of a run while it drives: one changing line on a terminal, lines with levels for log files and systemd."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from enum import Enum
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.status import Status as Spinner

from companion.app import Status
from companion.core.severity import Severity

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


class LiveConsole(Console):
    """Standard error, which may lose its reader."""

    def on_broken_pipe(self) -> None:
        """Called when the reader has gone. rich would end the program; here the rover drives on."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.file.fileno())
        os.close(nowhere)


class Live:
    """A context manager that shows the companion's status; call ``show`` after every tick."""

    def __init__(self, console: Console, name: str, reader: Reader = Reader.PERSON) -> None:
        self._console = console
        self._reader = reader
        self._name = name
        self._spinner = Spinner("connecting", console=console, refresh_per_second=4.0) if console.is_terminal else None
        self._shown = ""
        self._updated_s = -UPDATE_S
        self._broken = False

    def __enter__(self) -> Live:
        """Start the changing line."""
        if self._spinner is not None:
            self._spinner.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal."""
        if self._spinner is not None:
            with contextlib.suppress(OSError):
                self._spinner.stop()

    def show(self, status: Status) -> None:
        """Show what is new. A lost terminal or a full disk does not end the run."""
        if self._broken:
            return
        try:
            self._show(status)
        except OSError:
            self._broken = True

    def tell(self, text: str, severity: Severity) -> None:
        """A line from elsewhere."""
        if not self._broken:
            try:
                self._print(text, severity)
            except OSError:
                self._broken = True

    def _show(self, status: Status) -> None:
        for news in status.news:
            self._print(news.text, news.severity)
        if self._spinner is None:
            line = f"{status.doing}{f': {status.target}' if status.target else ''}"
            if line != self._shown:
                self._shown = line
                self._print(line, Severity.INFO)
        elif status.time_s - self._updated_s >= UPDATE_S:
            self._updated_s = status.time_s
            self._spinner.update(_line(status))

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
