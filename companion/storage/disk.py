"""Files that are whole at any moment, whatever ends the program or the power: written beside, forced out, then renamed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Protocol

BESIDE = ".new"
PRIVATE, SHARED = 0o600, 0o666
"""A state file tells where somebody's rover has been: only its owner may read it. What a user asks for is like any other file."""


class Disk(Protocol):
    """The steps of which a file is written, each of which may be the last one. All raise OSError."""

    def create(self, path: Path) -> int:
        """Open an empty file for writing; its handle."""
        ...

    def write(self, handle: int, data: bytes) -> int:
        """Write the beginning of ``data``; how much of it."""
        ...

    def sync(self, handle: int) -> None:
        """Return when what was written would outlast a loss of power."""
        ...

    def close(self, handle: int) -> None:
        """Give the handle back."""
        ...

    def rename(self, old: Path, new: Path) -> None:
        """Give a file another name, in one step, in place of what had that name."""
        ...

    def sync_directory(self, path: Path) -> None:
        """Return when the names in a directory would outlast a loss of power."""
        ...

    def remove(self, path: Path) -> None:
        """Remove a file."""
        ...


class OsDisk:
    """The real one."""

    def __init__(self, mode: int = PRIVATE) -> None:
        """``mode``: who may read and write the files, less what the process takes away (umask)."""
        self._mode = mode

    def create(self, path: Path) -> int:
        """See Disk."""
        # With O_NONBLOCK a pipe of that name is an error and not waited for.
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK | os.O_CLOEXEC, self._mode)

    def write(self, handle: int, data: bytes) -> int:
        """See Disk."""
        return os.write(handle, data)

    def sync(self, handle: int) -> None:
        """See Disk."""
        os.fsync(handle)

    def close(self, handle: int) -> None:
        """See Disk."""
        os.close(handle)

    def rename(self, old: Path, new: Path) -> None:
        """See Disk."""
        os.replace(old, new)

    def sync_directory(self, path: Path) -> None:
        """See Disk."""
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    def remove(self, path: Path) -> None:
        """See Disk."""
        path.unlink()


def replace_file(disk: Disk, path: Path, data: bytes) -> None:
    """Put ``data`` in place of a file. Whatever happens meanwhile, the file is the old one or the new one, whole. Raises OSError."""
    beside = path.with_name(path.name + BESIDE)
    try:
        handle = disk.create(beside)
        try:
            view = memoryview(data)
            while view:
                view = view[disk.write(handle, bytes(view)) :]
            disk.sync(handle)
        finally:
            disk.close(handle)
        disk.rename(beside, path)
    except OSError:
        with contextlib.suppress(OSError):
            disk.remove(beside)
        raise
    disk.sync_directory(path.parent)


def write_whole(path: Path, data: bytes) -> None:
    """Put ``data`` in place of a file that others may read too (see ``replace_file``). Raises OSError."""
    replace_file(OsDisk(SHARED), path, data)


def set_aside(path: Path, word: str) -> Path:
    """Rename a file to its name with a word and, from the second on, a number; the new name. Raises OSError."""
    place, number = path.with_name(f"{path.name}.{word}"), 2
    while place.exists():
        place, number = path.with_name(f"{path.name}.{word}-{number}"), number + 1
    path.rename(place)
    return place
