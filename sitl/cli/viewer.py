"""``--view``: draws on the terminal in a thread of its own, so that a slow or stopped terminal never holds the vehicle up."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
from types import FrameType, TracebackType

from rich.console import Console, RenderableType
from rich.live import Live

from sitl.view.view import View, render

FRAMES_HZ = 5.0
"""Often enough to see it drive, seldom enough for a slow connection."""
CLOSING_S = 1.0
"""A terminal that takes nothing any more is left after so long."""


class ViewError(Exception):
    """No terminal to draw on; the text is one line."""


def terminal() -> Console:
    """The terminal on standard output. Raises ViewError if there is none that can be drawn on."""
    console = Console()
    if not console.is_terminal or not console.file.isatty():
        raise ViewError("--view: standard output is no terminal; leave the option out, or run this in one")
    if console.is_dumb_terminal:
        raise ViewError("--view: this terminal cannot move its cursor (TERM=dumb); set TERM, or leave the option out")
    return console


class Viewer:
    """Shows the newest of the states that are handed to it. The terminal is put back as it was on leaving, errors included."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, screen=True, auto_refresh=False)
        self._wake = threading.Condition()
        self._view: View | None = None
        self._drawn: View | None = None
        self._ended = False
        self._due_s = -math.inf
        self._thread = threading.Thread(target=self._draw, name="view", daemon=True)

    def is_due(self, now_s: float) -> bool:
        """Whether it is time for a new picture; at most ``FRAMES_HZ`` times a second of real time."""
        if now_s < self._due_s:
            return False
        self._due_s = now_s + 1.0 / FRAMES_HZ
        return True

    def show(self, view: View) -> None:
        """Draw this next; returns at once."""
        with self._wake:
            self._view = view
            self._wake.notify()

    def __enter__(self) -> Viewer:
        """Take the terminal over."""
        self._live.start(refresh=False)
        self._thread.start()
        self._tstp_before = signal.signal(signal.SIGTSTP, self._suspend)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the terminal back."""
        signal.signal(signal.SIGTSTP, self._tstp_before)
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(CLOSING_S)
        if not self._thread.is_alive():
            with contextlib.suppress(OSError):
                self._live.stop()

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        """Ctrl-Z: the terminal is the shell's until this process is continued."""
        self._console.set_alt_screen(False)
        self._console.show_cursor(True)
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        # Continued.
        signal.signal(signal.SIGTSTP, self._suspend)
        self._console.set_alt_screen(True)
        self._console.show_cursor(False)
        with self._wake:
            self._drawn = None
            self._wake.notify()

    def print_last(self) -> None:
        """The last state, once more, where it stays."""
        if self._view is not None:
            rows = self._console.height - 1
            self._console.print(self._rendered(self._view, rows), height=rows)

    def _draw(self) -> None:
        """Draw what is new until the end; a terminal that has gone ends it too."""
        with contextlib.suppress(OSError):
            while True:
                with self._wake:
                    self._wake.wait_for(lambda: self._ended or self._view is not self._drawn)
                    if self._ended:
                        return
                    self._drawn = self._view
                assert self._drawn is not None
                self._live.update(self._rendered(self._drawn, self._console.height), refresh=True)

    def _rendered(self, view: View, rows: int) -> RenderableType:
        colour = not self._console.no_color and self._console.color_system is not None
        return render(view, self._console.width, rows, colour=colour)
