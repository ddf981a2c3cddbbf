"""Writes the state file: at once (lock-step), or in a thread of its own, so that no tick waits for a disk."""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from companion.disk import Disk, replace_file
from companion.state.format import BandPlace, Raster, deflated, encoded
from companion.state.snapshot import Snapshot, saved_state


@dataclass(frozen=True, eq=False, slots=True)
class Update:
    """What is new: rows of the map, copied (with ``afresh`` all older ones are void); with a snapshot the file is to be written."""

    rows: Mapping[BandPlace, Raster] = field(default_factory=dict)
    snapshot: Snapshot | None = None
    afresh: bool = False


class Writer(Protocol):
    """Takes updates in order."""

    @property
    def busy(self) -> bool:
        """Whether there are updates that have not been dealt with."""
        ...

    @property
    def problem(self) -> str:
        """Why the state could not be written the last time; empty while all is well."""
        ...

    def put(self, update: Update) -> None:
        """One more."""
        ...

    def close(self) -> None:
        """Deal with what is left."""
        ...


class StateFile:
    """The bands of the map that are known, and the file. A disk that is full today may not be so tomorrow: every write is tried."""

    def __init__(self, path: Path, disk: Disk) -> None:
        self.path = path
        self.problem = ""
        self._disk = disk
        self._bands: dict[BandPlace, bytes] = {}
        self._written = b""

    def take(self, update: Update) -> None:
        """Keep the rows; write the file if there is a snapshot and it says something new."""
        if update.afresh:
            self._bands.clear()
        for place, rows in update.rows.items():
            self._bands[place] = deflated(rows)
        if update.snapshot is None:
            return
        try:
            data = encoded(saved_state(update.snapshot), self._bands)
            if data != self._written or self.problem:
                replace_file(self._disk, self.path, data)
            self._written, self.problem = data, ""
        except OSError as error:
            self.problem = f"{self.path}: the state cannot be saved: {error.strerror or error}"
        except ValueError as error:  # a figure that no run should have
            self.problem = f"{self.path}: the state cannot be saved: {str(error).splitlines()[0]}"


class InlineWriter:
    """Writes at once: the same run leaves the same file at every moment."""

    def __init__(self, file: StateFile) -> None:
        self._file = file

    @property
    def busy(self) -> bool:
        """Never."""
        return False

    @property
    def problem(self) -> str:
        """See Writer."""
        return self._file.problem

    def put(self, update: Update) -> None:
        """See Writer."""
        self._file.take(update)

    def close(self) -> None:
        """Nothing is left."""


class ThreadWriter:
    """Writes beside the loop. The thread ends with the program, whatever the disk does: ``close`` waits only so long."""

    def __init__(self, file: StateFile, close_s: float = 0.5) -> None:
        self._file = file
        self._close_s = close_s
        self._updates: queue.SimpleQueue[Update | None] = queue.SimpleQueue()
        self._given = self._taken = 0
        self._thread = threading.Thread(target=self._work, name="state", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """See Writer."""
        return self._given != self._taken

    @property
    def problem(self) -> str:
        """See Writer."""
        return self._file.problem

    def put(self, update: Update) -> None:
        """See Writer."""
        self._given += 1
        self._updates.put(update)

    def close(self) -> None:
        """See Writer; gives up after a while."""
        self._updates.put(None)
        self._thread.join(self._close_s)

    def _work(self) -> None:
        """Of snapshots that have piled up behind a slow disk only the newest is written."""
        newest = None
        while True:
            update = self._updates.get()
            if update is not None:
                self._file.take(Update(update.rows, None, update.afresh))
                newest = update.snapshot or newest
            if newest is not None and (update is None or self._updates.empty()):
                self._file.take(Update(snapshot=newest))
                newest = None
            if update is None:
                return
            self._taken += 1
