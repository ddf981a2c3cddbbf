"""``run --view``: the picture on the terminal in place of lines; lines go on where it cannot be drawn."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Annotated

import typer

from companion.app import Companion, Status
from companion.cli.live import STDERR, STDOUT, Live
from companion.core.clock import stopwatch_s
from companion.core.severity import Severity
from companion.storage.unbuffered import let_go, shared_with
from companion.viewer.terminal.painter import CLOSING_S, Painter, ViewError, terminal
from companion.viewer.terminal.run_view import RunView

View = Annotated[bool, typer.Option("--view", help="Show map, rover and decisions on this terminal.")]
VIEWS_HZ = 3.0
"""Fewer than in the simulator: the drawing shares a small processor with the drive."""


def painter_for(*, view: bool, say: Callable[[str], None]) -> Painter | None:
    """What draws on the terminal, if that was asked for and there is one; otherwise it is said that there is none."""
    if not view:
        return None
    try:
        return Painter(terminal(sys.stderr), VIEWS_HZ)
    except ViewError as error:
        say(f"{error}; the run is told in lines")
        return None


class LiveView:
    """A context manager like ``Live``, which shows the picture; ``lines`` take over if it cannot be drawn.

    It begins with ``follow``. At the end the last picture stays on the terminal.
    """

    def __init__(self, painter: Painter, lines: Live, name: str) -> None:
        self._painter = painter
        self._lines = lines
        self._name = name
        self._run: RunView | None = None
        self._in_lines = False

    def follow(self, companion: Companion) -> None:
        """From now on this companion is shown."""
        self._run = RunView(companion, self._name)

    def __enter__(self) -> LiveView:
        """Take over the terminal."""
        self._painter.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal. If nobody reads it any more, what is still said is dropped: no one waits for it."""
        self._painter.__exit__(kind, error, trace)
        if self._in_lines:
            self._lines.__exit__(kind, error, trace)
        elif self._painter.stuck or (kind is None and not self._painter.problem and not self._printed_last()):
            let_go(shared_with(STDERR, (STDOUT,)))

    def _printed_last(self) -> bool:
        """Print the last picture; whether the terminal took it in time."""
        thread = threading.Thread(target=self._print_last, name="last view", daemon=True)
        thread.start()
        thread.join(CLOSING_S)
        return not thread.is_alive()

    def _print_last(self) -> None:
        with contextlib.suppress(Exception):  # a picture is not worth the result
            self._painter.print_last()

    def unhurried(self, seconds: float) -> None:
        """As in ``Live``, if lines have taken over; the picture is not waited for."""
        self._lines.unhurried(seconds)

    def tell(self, text: str, severity: Severity) -> None:
        """A line from elsewhere."""
        if self._in_lines or self._run is None:
            self._lines.tell(text, severity)
        else:
            self._run.tell(text)

    def show(self, status: Status) -> None:
        """To be called after each tick; never waits for the terminal."""
        if self._in_lines or self._run is None:
            self._lines.show(status)
            return
        problem = self._painter.problem
        try:
            self._run.note(status)
            if self._painter.is_due(stopwatch_s()) or self._run.is_over:
                self._painter.show(self._run.view(status))
        except Exception as error:  # a picture is not worth a stop
            problem = f"{type(error).__name__}: {error}"
        if problem:
            self._in_lines = True
            self._painter.close()
            self._lines.__enter__()
            self._lines.tell(f"--view: nothing is drawn any more, the drive goes on: {problem}", Severity.WARNING)
            self._lines.show(status)
