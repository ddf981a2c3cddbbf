"""Work that may wait for a disk, done beside the loop that must not."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

Job = Callable[[], None]


class Beside:
    """Does jobs in order in a thread of its own, which ends with the program, whatever the disk does. Jobs must not raise."""

    def __init__(self, name: str, close_s: float = 0.5) -> None:
        """``close_s``: how long ``close`` waits for what is left."""
        self._close_s = close_s
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
        self._thread.join(self._close_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            self._done += 1
