"""Small files written whole, away from the loop that must not wait for a disk."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from pathlib import Path

from companion.disk import Disk, OsDisk, replace_file


class Saver:
    """Writes whole files in a thread of its own, in order; of those that wait for the same file only the newest.

    The thread ends with the program, whatever the disk does: ``close`` waits only so long.
    """

    def __init__(self, disk: Disk | None = None, close_s: float = 0.5) -> None:
        self.problem = ""
        """Why the last file could not be written; empty while all is well."""
        self._disk = disk or OsDisk()
        self._close_s = close_s
        self._waiting: dict[Path, tuple[bytes, Callable[[], None] | None]] = {}
        self._lock = threading.Lock()
        self._work: queue.SimpleQueue[bool] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def save(self, path: Path, data: bytes, done: Callable[[], None] | None = None) -> None:
        """Have a file written; returns at once. ``done`` is called when it is on the disk, or could not be written."""
        with self._lock:
            self._waiting[path] = (data, done)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="saver", daemon=True)
            self._thread.start()
        self._work.put(True)

    def close(self) -> None:
        """Write what is left, but give up on a disk that hangs; more than once is fine."""
        if self._thread is None:
            return
        self._work.put(False)
        self._thread.join(self._close_s)
        if self._thread.is_alive():
            with self._lock:
                late = next(iter(self._waiting), None)
            self.problem = f"{late}: not written yet: the disk does not answer" if late else self.problem

    def _run(self) -> None:
        while self._work.get():
            self._write()

    def _write(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    return
                path = next(iter(self._waiting))
                entry = self._waiting[path]
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(self._disk, path, entry[0])
                self.problem = ""
            except OSError as error:
                self.problem = f"{path}: cannot be written: {error.strerror or error}"
            if entry[1] is not None:
                entry[1]()
            with self._lock:
                if self._waiting.get(path) is entry:
                    del self._waiting[path]
