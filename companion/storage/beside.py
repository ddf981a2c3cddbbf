"""Work that may wait for a disk, done beside the loop that must not."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from companion.core.clock import Clock, WallClock

Job = Callable[[], None]
PATIENCE_S = 0.5
"""A program that is told to end has a second for everything."""


class Patience:
    """How long the end of a program waits for its disks in all: who waits takes from what the others have."""

    def __init__(self, seconds: float = PATIENCE_S, clock: Clock | None = None) -> None:
        self._left_s = seconds
        self._clock = clock or WallClock()

    def extend(self, seconds: float) -> None:
        """There is no hurry: wait so much longer in all."""
        self._left_s += seconds

    def wait(self, thread: threading.Thread) -> bool:
        """Whether a thread has ended, now or within the time that is left."""
        began_s = self._clock.now_s()
        thread.join(max(0.0, self._left_s))
        self._left_s -= self._clock.now_s() - began_s
        return not thread.is_alive()


class Beside:
    """Does jobs in order in a thread of its own, which ends with the program, whatever the disk does. Jobs must not raise."""

    def __init__(self, name: str, patience: Patience | None = None) -> None:
        """``patience``: how long ``close`` waits for what is left; its own, if it shares none."""
        self._patience = patience or Patience()
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._given = self._done = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def busy(self) -> bool:
        """Whether a job is being done or waits."""
        return self._given != self._done

    @property
    def behind(self) -> bool:
        """Asked by a job: whether others follow it."""
        return self._given - self._done > 1

    def put(self, job: Job) -> None:
        """One more; returns at once."""
        if not self._given:
            self._thread.start()
        self._given += 1
        self._jobs.put(job)

    def close(self) -> bool:
        """Do what is left, but give up on a disk that hangs: whether all was done. More than once is fine."""
        if not self._given:
            return True
        self._jobs.put(None)
        return self._patience.wait(self._thread)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            self._done += 1
