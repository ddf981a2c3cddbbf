"""Draws the view on the terminal in its own thread, so that a slow terminal does not delay the vehicle."""

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
"""Pictures per second: enough to see it drive, few enough for a slow connection."""
CLOSING_S = 1.0
"""How long to wait for a terminal that accepts nothing any more."""


class ViewError(Exception):
    """There is no usable terminal; the text is one line."""


def terminal() -> Console:
    """The terminal on standard output. Raises ViewError if there is none to draw on."""
    console = Console()
    if not console.is_terminal or not console.file.isatty():
        raise ViewError("--view: standard output is not a terminal; run this in a terminal, or leave the option out")
    if console.is_dumb_terminal:
        raise ViewError("--view: this terminal cannot move its cursor (TERM=dumb); set TERM, or leave the option out")
    return console


class Viewer:
    """Shows the newest of the views handed to it, and restores the terminal on leaving, errors included."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, screen=True, auto_refresh=False)
        self._wake = threading.Condition()
        self._view: View | None = None
        self._is_new = False
        self._ended = False
        self._due_s = -math.inf
        self._thread = threading.Thread(target=self._draw, name="view", daemon=True)

    def is_due(self, now_s: float) -> bool:
        """Whether a new picture is due, at most ``FRAMES_HZ`` times per second of real time."""
        if now_s < self._due_s:
            return False
        self._due_s = now_s + 1.0 / FRAMES_HZ
        return True

    def show(self, view: View) -> None:
        """Draw this view next; returns at once."""
        with self._wake:
            self._view, self._is_new = view, True
            self._wake.notify()

    def __enter__(self) -> Viewer:
        """Take over the terminal."""
        self._live.start(refresh=False)
        self._thread.start()
        self._tstp_before = signal.signal(signal.SIGTSTP, self._suspend)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the terminal."""
        signal.signal(signal.SIGTSTP, self._tstp_before)
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(CLOSING_S)
        if not self._thread.is_alive():
            with contextlib.suppress(OSError):
                self._live.stop()

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        """Ctrl-Z: restore the terminal until this process continues."""
        self._console.set_alt_screen(False)
        self._console.show_cursor(True)
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        # Execution continues here.
        signal.signal(signal.SIGTSTP, self._suspend)
        self._console.set_alt_screen(True)
        self._console.show_cursor(False)
        with self._wake:
            self._is_new = self._view is not None
            self._wake.notify()

    def print_last(self) -> None:
        """Print the last view, so that it stays on the terminal."""
        if self._view is not None:
            rows = self._console.height - 1
            self._console.print(self._rendered(self._view, rows), height=rows)

    def _draw(self) -> None:
        """Draw new views until the end, or until the terminal is gone."""
        with contextlib.suppress(OSError):
            while True:
                with self._wake:
                    self._wake.wait_for(lambda: self._ended or self._is_new)
                    if self._ended:
                        return
                    view, self._is_new = self._view, False
                assert view is not None
                self._live.update(self._rendered(view, self._console.height), refresh=True)

    def _rendered(self, view: View, rows: int) -> RenderableType:
        colour = not self._console.no_color and self._console.color_system is not None
        return render(view, self._console.width, rows, colour=colour)
