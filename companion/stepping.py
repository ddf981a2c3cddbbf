"""Where the navigator's step is computed: at once (lock-step), or in a thread of its own (real time).

A search on a large map may take long; heartbeat, watchdogs and stop commands must not wait for it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from companion.navigator import Decision, NavState

StepCall = Callable[[], tuple[NavState, Decision]]


class StepRunner(Protocol):
    """Computes one step at a time."""

    @property
    def busy(self) -> bool:
        """Whether a step has been started and its result not been taken."""
        ...

    @property
    def working(self) -> bool:
        """Whether a step is being computed at this moment."""
        ...

    def start(self, call: StepCall) -> None:
        """Begin; only when not busy."""
        ...

    def take(self) -> tuple[NavState, Decision] | None:
        """The result, once; None while it is not there."""
        ...

    def close(self) -> None:
        """End the thread, if there is one."""
        ...


class InlineRunner:
    """Computes at once: the same inputs give the same run."""

    def __init__(self) -> None:
        self._result: tuple[NavState, Decision] | None = None

    @property
    def busy(self) -> bool:
        """Whether a result waits to be taken."""
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


class ThreadRunner:
    """Computes beside the loop; the compiled kernels release the interpreter lock."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="navigator")
        self._future: Future[tuple[NavState, Decision]] | None = None

    @property
    def busy(self) -> bool:
        """Whether a step runs or its result waits."""
        return self._future is not None

    @property
    def working(self) -> bool:
        """Whether the thread has not finished yet."""
        return self._future is not None and not self._future.done()

    def start(self, call: StepCall) -> None:
        """Hand the step to the thread."""
        self._future = self._pool.submit(call)

    def take(self) -> tuple[NavState, Decision] | None:
        """The result if the thread has it; raises what the step raised."""
        if self._future is None or not self._future.done():
            return None
        future, self._future = self._future, None
        return future.result()

    def close(self) -> None:
        """Do not wait for a step that nobody will take."""
        self._pool.shutdown(wait=False, cancel_futures=True)
