"""Signals that stop a run: the rover first, then the program."""

from __future__ import annotations

import signal
import threading
from types import FrameType

import typer

from companion.cli.entry import EXIT_STOPPED
from companion.cli.source import Stoppable
from companion.core.interrupts import SignalExit
from companion.safety.reasons import EndReason

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
AGAIN_S = 1.0
"""So long after a signal the program must have ended, or the signal is raised again."""


class StopSignals:
    """SIGINT, SIGTERM and a closed terminal stop the rover, then end the run.

    Before the drive they end the program at once. An exception that is raised within a compiler's callback is lost, so
    it is raised again until the program ends, and a drive does not begin.
    """

    def __init__(self) -> None:
        self.asked = False
        self.why: EndReason | None = None
        """Who asked: a person with Ctrl-C, or another program; None before."""
        self._listener: Stoppable | None = None
        self._again: threading.Timer | None = None

    @property
    def listener(self) -> Stoppable | None:
        """Who is told; None before the drive."""
        return self._listener

    @listener.setter
    def listener(self, listener: Stoppable | None) -> None:
        if self.asked and self._listener is None:
            raise SignalExit(EXIT_STOPPED)
        self._listener = listener

    def __enter__(self) -> StopSignals:
        """Install the handlers."""
        self._before = {number: signal.signal(number, self._stop) for number in STOPPING}
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the former handlers."""
        if self._again is not None:
            self._again.cancel()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self.why = EndReason.STOPPED_BY_USER if number == signal.SIGINT else EndReason.TERMINATED
        if self._listener is not None:
            self.asked = True
            self._listener.stop()
            return
        if not self.asked:
            typer.echo("stopped before anything was sent to the rover", err=True)
        self.asked = True
        self._again = threading.Timer(AGAIN_S, signal.raise_signal, (number,))
        self._again.daemon = True
        self._again.start()
        raise SignalExit(EXIT_STOPPED)
