"""Runs the navigator's step: at once (lock-step) or in a thread of its own (real time).

A search on a large map may take long. Heartbeats, watchdogs and stop commands must not wait for it.

Nouns: step runner.
"""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread
from typing import Protocol

from companion.core.tick_marks import Mark
from companion.navigation.field_step import Decision, NavState

StepCall = Callable[[], tuple[NavState, Decision]]


class StepRunner(Protocol):
    """Computes one step at a time."""

    @property
    def busy(self) -> bool:
        """Whether a step has been started and its result has not been taken."""
        ...

    @property
    def working(self) -> bool:
        """Whether a step is being computed at this moment."""
        ...

    def start(self, call: StepCall) -> None:
        """Begin; only when not busy."""
        ...

    def take(self) -> tuple[NavState, Decision] | None:
        """The result, once; None before it is ready."""
        ...

    def close(self) -> None:
        """End the thread, if there is one."""
        ...


class InlineRunner:
    """Computes each step at once, so the same inputs give the same run."""

    def __init__(self) -> None:
        self._result: tuple[NavState, Decision] | None = None

    @property
    def busy(self) -> bool:
        """Whether there is a result to be taken."""
        return self._result is not None

    @property
    def working(self) -> bool:
        """Never between two calls."""
        return False

    def start(self, call: StepCall) -> None:
        """Compute now."""
        self._result = call()

    def take(self) -> tuple[NavState, Decision] | None:
        """The result, once."""
        result, self._result = self._result, None
        return result

    def close(self) -> None:
        """Nothing to end."""


class NotedRunner:
    """A runner that notes what a thread makes unpredictable: that it works, and when its results are taken."""

    def __init__(self, runner: StepRunner, note: Callable[[Mark], None]) -> None:
        self._runner = runner
        self._note = note

    @property
    def busy(self) -> bool:
        """See ``StepRunner``."""
        return self._runner.busy

    @property
    def working(self) -> bool:
        """See ``StepRunner``."""
        works = self._runner.working
        if works:
            self._note(Mark.WORKING)
        return works

    def start(self, call: StepCall) -> None:
        """See ``StepRunner``."""
        self._runner.start(call)

    def take(self) -> tuple[NavState, Decision] | None:
        """See ``StepRunner``. An error is noted like a result."""
        try:
            result = self._runner.take()
        except Exception:
            self._note(Mark.ANSWER)
            raise
        if result is not None:
            self._note(Mark.ANSWER)
        return result

    def close(self) -> None:
        """See ``StepRunner``."""
        self._runner.close()


class ThreadRunner:
    """Computes in a thread beside the loop. The compiled kernels release the interpreter lock.

    The thread is a daemon: it never prevents the program from ending.
    """

    def __init__(self) -> None:
        self._calls: SimpleQueue[StepCall | None] = SimpleQueue()
        self._results: SimpleQueue[tuple[NavState, Decision] | BaseException] = SimpleQueue()
        self._busy = False
        Thread(target=self._work, name="navigator", daemon=True).start()

    @property
    def busy(self) -> bool:
        """Whether a step is running or its result has not been taken."""
        return self._busy

    @property
    def working(self) -> bool:
        """Whether the thread has not finished the step."""
        return self._busy and self._results.empty()

    def start(self, call: StepCall) -> None:
        """Hand the step to the thread."""
        self._busy = True
        self._calls.put(call)

    def take(self) -> tuple[NavState, Decision] | None:
        """The result if it is ready. Raises what the step raised."""
        if self._results.empty():
            return None
        result = self._results.get()
        self._busy = False
        if isinstance(result, BaseException):
            raise result
        return result

    def close(self) -> None:
        """End the thread after its present step, without waiting for it."""
        self._calls.put(None)

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            try:
                self._results.put(call())
            except BaseException as error:
                self._results.put(error)
