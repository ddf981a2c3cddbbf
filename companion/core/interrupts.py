"""Ctrl-C and SIGTERM: whether an error is one, and steps that they do not cut in two."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Self

NUMBERS = (signal.SIGINT, signal.SIGTERM)

Handler = Callable[[int, FrameType | None], object]


class SignalExit(SystemExit):
    """A signal asked for the end of the program. What else ends it with SystemExit is somebody's fault."""


class Terminated(KeyboardInterrupt):
    """SIGTERM has interrupted a command that it ends as Ctrl-C does."""


def is_interrupt(error: BaseException | None) -> bool:
    """Whether a KeyboardInterrupt or a SignalExit is behind this error, however many others lie between.

    An interrupt inside a compiled loop comes out as one SystemError, or as several.
    """
    return any(isinstance(one, KeyboardInterrupt | SignalExit) for one in _behind(error))


def was_terminated(error: BaseException | None) -> bool:
    """Whether the interrupt behind this error is SIGTERM."""
    return any(isinstance(one, Terminated) for one in _behind(error))


def _behind(error: BaseException | None) -> Iterator[BaseException]:
    """An error, what caused it, what caused that, and so on."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        yield error
        seen.add(id(error))
        error = error.__cause__ or error.__context__


class WholeSteps:
    """Within ``with``, an interrupt in the middle of a step is heeded at its end, so that what it writes is whole.

    A second one is heeded at once. Outside the main thread, which alone hears of signals, nothing changes.
    """

    def __init__(self) -> None:
        self._earlier: dict[int, Handler] = {}
        self._in_step = False
        self._waiting = 0

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in NUMBERS:
                handler = signal.getsignal(number)
                if callable(handler):  # a signal that is ignored stays so
                    self._earlier[number] = handler
                    signal.signal(number, self._heed)
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._earlier.items():
            signal.signal(number, handler)

    def do(self, step: Callable[[], None]) -> None:
        """One step, and then the interrupt that came within it."""
        self._in_step = True
        try:
            step()
        finally:
            self._in_step = False
            waiting, self._waiting = self._waiting, 0
            if waiting:
                self._earlier[waiting](waiting, None)

    def _heed(self, number: int, frame: FrameType | None) -> None:
        if self._in_step and not self._waiting:
            self._waiting = number
        else:
            self._earlier[number](number, frame)
