"""Draws views on the terminal in a thread of its own, so that a slow or stopped terminal delays nobody.

Only the newest view waits to be drawn, and only the lines that have changed are written.

Nouns: painter.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import TextIO, cast

from rich.console import Console

from companion.storage.unbuffered import UnbufferedOutput
from companion.viewer.terminal.screen import SMALLEST, View, render

VIEWS_HZ = 5.0
"""Views per second: enough to see it drive, few enough for a slow connection."""
CLOSING_S, SUSPENDING_S = 1.0, 0.3
"""How long to wait for a terminal that accepts nothing any more."""
ENTER, LEAVE, CLEAR = "\x1b[?1049h\x1b[?25l\x1b[2J\x1b[H", "\x1b[0m\x1b[?25h\x1b[?1049l", "\x1b[2J"
LAST_ROWS = SMALLEST[1] - 1
"""The last picture has at least so many: it leaves one for the prompt."""
NAMES = {1: "standard output", 2: "standard error"}

MakeView = Callable[[], View]


class ViewError(Exception):
    """There is no usable terminal; the text is one line."""


def terminal(stream: TextIO) -> Console:
    """The terminal that a stream leads to. Raises ViewError if there is none to draw on."""
    if not stream.isatty():
        name = NAMES.get(stream.fileno() if _has_descriptor(stream) else 1, "this output")
        raise ViewError(f"--view: {name} is not a terminal; run this in a terminal, or leave the option out")
    console = Console(file=cast(TextIO, UnbufferedOutput(stream.fileno())))
    if console.is_dumb_terminal:
        raise ViewError("--view: this terminal cannot move its cursor (TERM=dumb); set TERM, or leave the option out")
    return console


def _has_descriptor(stream: TextIO) -> bool:
    try:
        stream.fileno()
    except (OSError, ValueError):
        return False
    return True


class Painter:
    """Shows the newest of the views handed to it, and restores the terminal on leaving, errors included.

    A context manager of the main thread. ``problem``: why nothing is drawn any more; empty while all is well.
    """

    def __init__(self, console: Console, views_hz: float = VIEWS_HZ) -> None:
        self.problem = ""
        self._console = console
        self._views_hz = views_hz
        self._wake = threading.Condition()
        self._make: MakeView | None = None
        self._is_new = self._ended = self._suspended = False
        self._left = threading.Event()
        """Whether the terminal has been given back for a while."""
        self._due_s = -math.inf
        self._shown: tuple[tuple[int, int], list[str]] = ((0, 0), [])
        """Size and lines of what is on the terminal."""
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def is_due(self, now_s: float) -> bool:
        """Whether a new view is due, at most ``views_hz`` times per second of real time."""
        if now_s < self._due_s:
            return False
        self._due_s = now_s + 1.0 / self._views_hz
        return True

    def show(self, make: MakeView) -> None:
        """Draw this next; returns at once. ``make`` is called in the thread, if nothing newer comes before."""
        with self._wake:
            self._make, self._is_new = make, True
            self._wake.notify()

    def __enter__(self) -> Painter:
        """Take over the terminal."""
        self._thread.start()
        self._tstp_before = signal.signal(signal.SIGTSTP, self._suspend)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal."""
        self.close()

    def close(self) -> None:
        """Restore the terminal; waits for it no longer than ``CLOSING_S``. May be called again."""
        if self._ended:
            return
        signal.signal(signal.SIGTSTP, self._tstp_before)
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(CLOSING_S)

    @property
    def stuck(self) -> bool:
        """After the end: whether the terminal takes nothing, so that whoever writes to it waits."""
        return self._ended and self._thread.is_alive()

    def print_last(self, rows_below: int = 0) -> None:
        """Print the last view, so that it stays on the terminal, with room for some lines below.

        Where that leaves too few rows for a picture that was there until now, it is drawn one row smaller than is
        usual, for the prompt; the lines below then move it up.
        """
        if self._make is not None:
            height = self._console.height
            least = LAST_ROWS if height >= SMALLEST[1] else 1
            lines = self._lines(self._make(), max(height - 1 - rows_below, least), LAST_ROWS)
            self._console.file.write("\n".join(lines) + "\n")

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        """Ctrl-Z: restore the terminal until this process continues."""
        self._left.clear()
        with self._wake:
            self._suspended = True
            self._wake.notify()
        self._left.wait(SUSPENDING_S)
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        # Execution continues here.
        signal.signal(signal.SIGTSTP, self._suspend)
        with self._wake:
            self._suspended, self._is_new = False, self._make is not None
            self._wake.notify()

    def _run(self) -> None:
        """Draw new views until the end, or until the terminal is gone."""
        try:
            self._write(ENTER)
            while (make := self._next()) is not None:
                self._paint(make())
            self._write(LEAVE)
        except OSError as error:
            self.problem = f"the terminal is gone: {error.strerror or error}"
        except Exception as error:  # a picture is not worth a stop
            self.problem = f"{type(error).__name__}: {error}"
            with contextlib.suppress(OSError):
                self._write(LEAVE)

    def _next(self) -> MakeView | None:
        """The next view to draw; None at the end. Gives the terminal back while the process is suspended."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._ended or self._is_new or self._suspended)
                suspended = self._suspended and not self._ended
                if not suspended:
                    self._is_new = False
                    return None if self._ended else self._make
            self._write(LEAVE)
            self._left.set()
            with self._wake:
                self._wake.wait_for(lambda: self._ended or not self._suspended)
            self._write(ENTER)
            self._shown = ((0, 0), [])

    def _paint(self, view: View) -> None:
        """Write the lines that have changed."""
        size = (self._console.width, self._console.height)
        lines = self._lines(view, size[1])
        (size_before, before), self._shown = self._shown, (size, lines)
        text = "" if size == size_before else CLEAR
        before = before if size == size_before else []
        for row, line in enumerate(lines):
            if row >= len(before) or before[row] != line:
                text += f"\x1b[{row + 1};1H\x1b[2K{line}"
        if len(before) > len(lines):
            text += f"\x1b[{len(lines) + 1};1H\x1b[J"
        if text:
            self._write(text)

    def _lines(self, view: View, rows: int, least_rows: int = SMALLEST[1]) -> list[str]:
        """A view as lines of characters and control codes, at most so many. ``least_rows``: fewer give no picture."""
        console = self._console
        colour = not console.no_color and console.color_system is not None
        with console.capture() as captured:
            console.print(render(view, console.width, rows, colour=colour, least_rows=least_rows), height=rows)
        return captured.get().rstrip("\n").split("\n")[:rows]

    def _write(self, text: str) -> None:
        self._console.file.write(text)
        self._console.file.flush()
