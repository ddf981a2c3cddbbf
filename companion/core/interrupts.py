"""Ctrl-C and SIGTERM: whether an error is one, that none is lost, and steps that they do not cut in two."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

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


@contextlib.contextmanager
def none_lost() -> Iterator[None]:
    """Within ``with``, an interrupt that came in a callback from C is raised again right after it.

    No error leaves such a callback: Python prints it and goes on. The compiler is mostly in C, and calls back from it.
    """
    before = sys.unraisablehook

    def lost(what: UnraisableHookArgs) -> None:
        kind = what.exc_type
        if not issubclass(kind, KeyboardInterrupt):
            before(what)
            return

        def again(frame: FrameType, event: str, argument: object) -> None:
            if frame.f_code is not lost.__code__:
                sys.setprofile(None)
                raise kind

        sys.setprofile(again)  # called when the next function begins or ends

    sys.unraisablehook = lost
    try:
        yield
    finally:
        sys.unraisablehook = before


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
