"""A program on a pseudo-terminal, which reads what it draws, or does not."""

from __future__ import annotations

import os
import pty
import select
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tests.support.forked import LIMIT_S, Forked

ENTER, LEAVE, SHOW_CURSOR = b"\x1b[?1049h", b"\x1b[?1049l", b"\x1b[?25h"


@dataclass
class Drawn:
    """A running program and everything that it has written to its terminal so far."""

    child: Forked
    ours: int
    written: bytes = b""

    def read_until(self, text: bytes | None = None) -> bool:
        """Read until the text has appeared; None: to the end. Whether it has."""
        while text is None or text not in self.written:
            if not select.select([self.ours], [], [], LIMIT_S)[0]:
                return False
            try:
                data = os.read(self.ours, 65536)
            except OSError:  # the other end is closed
                data = b""
            if not data:
                return text is None
            self.written += data
        return True

    @property
    def last(self) -> bytes:
        """What was written after the terminal had been given back; it must have been taken before."""
        assert self.written.rindex(LEAVE) > self.written.rindex(ENTER)
        assert self.written.rindex(SHOW_CURSOR) > self.written.rindex(ENTER)
        return self.written[self.written.rindex(LEAVE) :]


@contextmanager
def on_a_terminal(module: str, *arguments: object, **variables: str) -> Iterator[Drawn]:
    """``rover-companion`` (module companion) or ``rover-sitl`` (module sitl) on a terminal of 80 x 24."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", **variables}
    with Forked(module, arguments, environment, terminal=theirs) as child:
        os.close(theirs)
        try:
            yield Drawn(child, ours)
        finally:
            child.kill()
            os.close(ours)


def ended(drawn: Drawn, number: signal.Signals | None = None) -> int:
    """Send a signal, read to the end; gives the exit code."""
    if number is not None:
        drawn.child.send_signal(number)
    drawn.read_until()
    return drawn.child.wait(timeout=LIMIT_S)
