"""Small files written whole, away from the loop that must not wait for a disk."""

from __future__ import annotations

import threading
from pathlib import Path

from companion.storage.beside import Beside, Job, Patience
from companion.storage.disk import Disk, OsDisk, replace_file


class Saver:
    """Writes whole files beside the loop, in order; of those that wait for the same file only the newest."""

    def __init__(self, disk: Disk | None = None, patience: Patience | None = None) -> None:
        self.problem = ""
        """Why the last file could not be written; empty while all is well."""
        self._disk = disk or OsDisk()
        self._waiting: dict[Path, tuple[bytes, Job | None]] = {}
        self._lock = threading.Lock()
        self._beside = Beside("saver", patience)

    def save(self, path: Path, data: bytes, done: Job | None = None) -> None:
        """Have a file written; returns at once. ``done`` is called when it is on the disk, or could not be written."""
        with self._lock:
            self._waiting[path] = (data, done)
        self._beside.put(self._write)

    def close(self) -> None:
        """Write what is left, but give up on a disk that hangs; more than once is fine."""
        if not self._beside.close():
            with self._lock:
                late = next(iter(self._waiting), None)
            self.problem = f"{late}: not written yet: the disk does not answer" if late else self.problem

    def _write(self) -> None:
        """The first file that waits; it counts as waiting until it is written. An earlier job may have written it already."""
        with self._lock:
            path = next(iter(self._waiting), None)
            if path is None:
                return
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
