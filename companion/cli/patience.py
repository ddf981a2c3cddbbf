"""Says once that something has taken long, so that nobody wonders whether the program still works.

Nouns: patience.
"""

from __future__ import annotations

import threading
from collections.abc import Callable


class Patience:
    """``say`` is called from another thread: ``limit_s`` of real time after the last ``begin``, if no ``end`` came."""

    def __init__(self, limit_s: float, say: Callable[[], None]) -> None:
        self._limit_s = limit_s
        self._say = say
        self._timer: threading.Timer | None = None

    def begin(self) -> None:
        """From now on; what was begun before has ended."""
        self.end()
        self._timer = threading.Timer(self._limit_s, self._say)
        self._timer.daemon = True
        self._timer.start()

    def end(self) -> None:
        """Nothing is waited for."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
