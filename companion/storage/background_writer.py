"""Background threads that write to disk, so that the control loop never waits for one."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from pathlib import Path

from companion.core.clock import Clock, WallClock
from companion.storage.files import Disk, OsDisk, replace_file

Job = Callable[[], None]
SHUTDOWN_S = 0.5
"""A program that is told to end has one second in all."""


class ShutdownBudget:
    """The time that the end of the program may spend waiting for background threads, shared by all of them."""

    def __init__(self, seconds: float = SHUTDOWN_S, clock: Clock | None = None) -> None:
        self._left_s = seconds
        self._clock = clock or WallClock()

    def extend(self, seconds: float) -> None:
        """Allow more time: nobody waits for the program to end."""
        self._left_s += seconds

    def wait(self, thread: threading.Thread) -> bool:
        """Join a thread within the time that is left; whether it has ended."""
        began_s = self._clock.now_s()
        thread.join(max(0.0, self._left_s))
        self._left_s -= self._clock.now_s() - began_s
        return not thread.is_alive()


class BackgroundWorker:
    """Does jobs in order in a daemon thread: a disk that hangs cannot keep the program alive. Jobs must not raise."""

    def __init__(self, name: str, budget: ShutdownBudget | None = None) -> None:
        """``budget``: how long ``close`` waits for the jobs that are left; default: a budget of its own."""
        self._budget = budget or ShutdownBudget()
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._given = self._done = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def busy(self) -> bool:
        """Whether a job is being done or is waiting."""
        return self._given != self._done

    @property
    def behind(self) -> bool:
        """For a job: whether more jobs are waiting after it."""
        return self._given - self._done > 1

    def put(self, job: Job) -> None:
        """Add a job; returns at once."""
        if not self._given:
            self._thread.start()
        self._given += 1
        self._jobs.put(job)

    def close(self) -> bool:
        """Finish the jobs that are left, as far as the budget allows; whether all are done. May be called again."""
        if not self._given:
            return True
        self._jobs.put(None)
        return self._budget.wait(self._thread)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            self._done += 1


class BackgroundWriter:
    """Writes whole files in a background thread, in order; of several contents for one file, only the newest."""

    def __init__(self, disk: Disk | None = None, budget: ShutdownBudget | None = None) -> None:
        self.problem = ""
        """Why the last file could not be written; empty if it was."""
        self._disk = disk or OsDisk()
        self._queued = 0
        self._waiting: dict[Path, tuple[int, bytes, Job | None]] = {}
        """By file: the number of its newest content, the content, what is called when it is written."""
        self._lock = threading.Lock()
        self._worker = BackgroundWorker("saver", budget)

    def save(self, path: Path, data: bytes, done: Job | None = None) -> None:
        """Queue a file; returns at once. ``done`` is called when it is on disk, or could not be written."""
        with self._lock:
            self._queued += 1
            self._waiting[path] = (self._queued, data, done)
        self._worker.put(self._write)

    def close(self) -> None:
        """Write the files that are left, as far as the budget allows. May be called again."""
        if not self._worker.close():
            with self._lock:
                late = next(iter(self._waiting), None)
            self.problem = f"{late}: not written yet: the disk does not answer" if late else self.problem

    def _write(self) -> None:
        """Write the first waiting file; it counts as waiting until it is written.

        An earlier job may have written it already.
        """
        with self._lock:
            path = next(iter(self._waiting), None)
            if path is None:
                return
            number, data, done = self._waiting[path]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._disk, path, data)
            self.problem = ""
        except OSError as error:
            self.problem = f"{path}: cannot be written: {error.strerror or error}"
        if done is not None:
            done()
        with self._lock:
            if self._waiting[path][0] == number:
                del self._waiting[path]
