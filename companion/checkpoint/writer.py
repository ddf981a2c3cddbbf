"""Writes the state file: at once (lock-step), or in a thread of its own, so that no tick waits for a disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Protocol

from companion.checkpoint.format import BandPlace, Raster, deflated, encoded
from companion.checkpoint.snapshot import Snapshot, saved_state
from companion.storage.beside import Beside, Patience
from companion.storage.disk import Disk, replace_file


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
    """Writes beside the loop."""

    def __init__(self, file: StateFile, patience: Patience | None = None) -> None:
        self._file = file
        self._newest: Snapshot | None = None
        self._beside = Beside("state", patience)
        self._is_late = False

    @property
    def busy(self) -> bool:
        """See Writer."""
        return self._beside.busy

    @property
    def problem(self) -> str:
        """See Writer."""
        late = f"{self._file.path}: the state is not saved yet: the disk does not answer"
        return late if self._is_late else self._file.problem

    def put(self, update: Update) -> None:
        """See Writer."""
        self._beside.put(partial(self._take, update))

    def close(self) -> None:
        """See Writer; gives up after a while."""
        self._is_late = not self._beside.close()

    def _take(self, update: Update) -> None:
        """Of snapshots that have piled up behind a slow disk only the newest is written."""
        self._file.take(Update(update.rows, None, update.afresh))
        self._newest = update.snapshot or self._newest
        if self._newest is not None and not self._beside.behind:
            self._file.take(Update(snapshot=self._newest))
            self._newest = None
