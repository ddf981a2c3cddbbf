"""What a run shows while it goes on: one line that changes on a terminal, a new line for every change elsewhere."""

from __future__ import annotations

import contextlib
import os
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.status import Status as Spinner

from companion.app import Status
from companion.cli.levels import INFO, Reader, levelled

UPDATE_S = 0.25


class LiveConsole(Console):
    """Standard error, for as long as somebody reads it."""

    def on_broken_pipe(self) -> None:
        """The reader has gone (rich itself would end the program here): the rover is driven on unseen."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.file.fileno())
        os.close(nowhere)


class Live:
    """A context manager; ``show`` takes the companion's status after every tick."""

    def __init__(self, console: Console, name: str, reader: Reader = Reader.PERSON) -> None:
        self._console = console
        self._reader = reader
        self._name = name
        self._spinner = Spinner("connecting", console=console, refresh_per_second=4.0) if console.is_terminal else None
        self._shown = ""
        self._updated_s = -UPDATE_S
        self._broken = False

    def __enter__(self) -> Live:
        """Begin to show."""
        if self._spinner is not None:
            self._spinner.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the terminal as it was."""
        if self._spinner is not None:
            with contextlib.suppress(OSError):
                self._spinner.stop()

    def show(self, status: Status) -> None:
        """Show what is new. A terminal that has gone, or a full disk under a log file, does not end the run."""
        if self._broken:
            return
        try:
            self._show(status)
        except OSError:
            self._broken = True

    def _show(self, status: Status) -> None:
        for news in status.news:
            self._print(news.text, news.severity)
        if self._spinner is None:
            line = f"{status.doing}{f': {status.target}' if status.target else ''}"
            if line != self._shown:
                self._shown = line
                self._print(line, INFO)
        elif status.time_s - self._updated_s >= UPDATE_S:
            self._updated_s = status.time_s
            self._spinner.update(_line(status))

    def _print(self, text: str, severity: int) -> None:
        line = levelled(f"{self._name}: {text}", severity, self._reader)
        self._console.print(line, soft_wrap=True, markup=False, highlight=False)


def _line(status: Status) -> str:
    parts = [f"{status.doing}"]
    if status.target:
        parts.append(escape(f"{status.target} [{status.targets_reached}/{status.targets}]"))
    if status.pose is not None:
        parts.append(f"north {status.pose.north_m:.1f} m, east {status.pose.east_m:.1f} m")
    if status.decision is not None:
        parts.append(f"part {status.decision.part}")
    return "  ".join([*parts, f"steps {status.steps}"])
