"""Writes the state file in a thread, so that no tick waits for a disk.

Nouns: state file.
"""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path

from companion.checkpoint.checkpointer import Snapshot, StateUpdate, saved_state
from companion.checkpoint.state_format import MapPart, compressed_part, encode_state
from companion.executive.command_progress import CommandProgress
from companion.executive.mission_progress import MissionProgress
from companion.storage.background_writer import BackgroundWorker, ShutdownBudget
from companion.storage.files import Disk, replace_file


class StateFile:
    """The file, and the parts of the map given so far. Every write is tried: a full disk may have room again.

    ``before``: what an older state is renamed to when the first parts come, as the rover then drives a mission from its
    beginning; None where that state is resumed.
    """

    def __init__(self, path: Path, disk: Disk, before: Path | None = None) -> None:
        self.path = path
        self.problem = ""
        self._before = before
        self._disk = disk
        self._parts: dict[tuple[str, int], tuple[MapPart, bytes]] = {}
        """By raster and first row: a newer part of the same rows holds at least the same columns."""
        self._written = b""
        self._commands: CommandProgress | None = None

    def holds(self, progress: MissionProgress) -> bool:
        """See StateWriter. The file that was written last, as far as is known."""
        return self._commands == progress.commands

    @property
    def is_saved(self) -> bool:
        """Whether this run has written the file."""
        return self._written != b""

    def apply(self, update: StateUpdate) -> None:
        """Keep the parts. If there is a snapshot, write the file unless its content is unchanged."""
        self._set_aside()
        if update.new_map:
            self._parts.clear()
        for part, cells in update.parts.items():
            self._parts[part.raster, part.first_row] = part, compressed_part(cells)
        if update.snapshot is None:
            return
        try:
            data = encode_state(saved_state(update.snapshot), dict(self._parts.values()))
            if data != self._written or self.problem:
                replace_file(self._disk, self.path, data)
            self._written, self.problem = data, ""
            self._commands = update.snapshot.progress.commands
        except OSError as error:
            self.problem = f"{self.path}: the state cannot be saved: {error.strerror or error}"
        except ValueError as error:  # a value outside the limits of SavedState
            self.problem = f"{self.path}: the state cannot be saved: {str(error).splitlines()[0]}"

    def _set_aside(self) -> None:
        """If that cannot be done, writing the file cannot either, and that is told."""
        before, self._before = self._before, None
        if before is not None:
            with contextlib.suppress(OSError):
                self._disk.rename(self.path, before)
                self._disk.sync_directory(self.path.parent)


class ThreadStateWriter:
    """Writes in a thread."""

    def __init__(self, file: StateFile, patience: ShutdownBudget | None = None) -> None:
        self._file = file
        self._newest: Snapshot | None = None
        self._worker = BackgroundWorker("state", patience)
        self._is_late = False

    @property
    def busy(self) -> bool:
        """See StateWriter."""
        return self._worker.busy

    @property
    def problem(self) -> str:
        """See StateWriter."""
        late = f"{self._file.path}: the state is not saved yet: the disk does not answer"
        return late if self._is_late else self._file.problem

    def holds(self, progress: MissionProgress) -> bool:
        """See StateWriter."""
        return self._file.holds(progress)

    def put(self, update: StateUpdate) -> None:
        """See StateWriter."""
        self._worker.put(partial(self._apply, update))

    def close(self) -> None:
        """See StateWriter. Gives up after some time."""
        self._is_late = not self._worker.close()

    def _apply(self, update: StateUpdate) -> None:
        """When snapshots wait behind a slow disk, only the newest is written."""
        self._file.apply(StateUpdate(update.parts, None, update.new_map))
        self._newest = update.snapshot or self._newest
        if self._newest is not None and not self._worker.behind:
            self._file.apply(StateUpdate(snapshot=self._newest))
            self._newest = None
