"""Small files written whole, away from the loop that must not wait for a disk."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from companion.disk import OsDisk, replace_file


class Saver:
    """Writes whole files in a thread of its own, in order; of those that wait for the same file only the newest."""

    def __init__(self) -> None:
        self.problem = ""
        """Why the last file could not be written; empty while all is well."""
        self._waiting: dict[Path, tuple[bytes, Callable[[], None] | None]] = {}
        self._lock = threading.Lock()
        self._thread = ThreadPoolExecutor(1, "saver")

    def save(self, path: Path, data: bytes, done: Callable[[], None] | None = None) -> None:
        """Have a file written; returns at once. ``done`` is called when it is on the disk, or could not be written."""
        with self._lock:
            begun = bool(self._waiting)
            self._waiting[path] = (data, done)
        if not begun:
            self._thread.submit(self._write)

    def close(self) -> None:
        """Write what is left; more than once is fine."""
        self._thread.shutdown(wait=True)

    def _write(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    return
                path = next(iter(self._waiting))
                entry = self._waiting[path]
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(OsDisk(), path, entry[0])
                self.problem = ""
            except OSError as error:
                self.problem = f"{path}: cannot be written: {error.strerror or error}"
            if entry[1] is not None:
                entry[1]()
            with self._lock:
                if self._waiting.get(path) is entry:
                    del self._waiting[path]
