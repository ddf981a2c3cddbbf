"""Files on disk: only ordinary files are opened, and files are replaced so that a loss of power leaves them whole.

A pipe would make the program wait and a device has no end: only ordinary files are opened. A file is replaced in three
steps: written under another name, synced, renamed.

Nouns: file.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Protocol

NEW_SUFFIX = ".new"
PRIVATE, SHARED = 0o600, 0o666
"""A state file shows where a rover has been: only its owner may read it.

Files that a user asks for have the usual mode.
"""


def open_file(path: Path) -> BufferedReader:
    """An ordinary file, open for reading.

    Raises OSError, also for a pipe, a socket or a device; never waits for another program.
    """
    # Without O_NONBLOCK, opening a pipe waits for a writer.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "not a file", str(path))


def read_at_most(path: Path, limit: int) -> bytes:
    """The whole content of an ordinary file.

    Raises OSError; a file of more than ``limit`` bytes is refused before it is read.
    """
    with open_file(path) as file:
        if os.fstat(file.fileno()).st_size > limit:
            raise OSError(errno.EFBIG, f"larger than {limit} bytes", str(path))
        return file.read(limit)


def read_bytes(path: Path, error: type[Exception], limit: int) -> bytes:
    """The content of an ordinary file.

    Raises ``error``, also for more than ``limit`` bytes: one line with file, reason and remedy.
    """
    try:
        with open_file(path) as file:
            data = file.read(limit + 1)
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}; check the path") from fault
    if len(data) > limit:
        raise error(f"{path}: larger than {limit} bytes; check the path")
    return data


def read_text(path: Path, error: type[Exception], limit: int, encoding: str = "utf-8") -> str:
    """The text of a file in UTF-8. Raises ``error``, as ``read_bytes`` does."""
    try:
        return read_bytes(path, error, limit).decode(encoding)
    except UnicodeDecodeError as fault:
        raise error(f"{path}: not UTF-8 text (byte {fault.start}); save it as UTF-8") from fault


def refuse_pipe(path: Path) -> None:
    """Call before writing a file.

    Raises OSError if the name is a pipe, a socket or a disk; a name that is free is fine.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or stat.S_ISBLK(mode):
        raise OSError(errno.EINVAL, "not a file", str(path))


def why_no_file(path: Path) -> str:
    """Why a name is not that of an ordinary file, and what to do about it; empty if it is one."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return "no such file; check the path"
    except OSError as error:
        return f"cannot be read: {error.strerror}; check the path"
    if stat.S_ISREG(mode):
        return ""
    return "is a folder, not a file; add a file's name" if stat.S_ISDIR(mode) else "not a file; name one"


class Disk(Protocol):
    """The steps in which a file is replaced; power may fail after any of them. All raise OSError."""

    def create(self, path: Path) -> int:
        """Open an empty file for writing; returns its handle."""
        ...

    def write(self, handle: int, data: bytes) -> int:
        """Write the beginning of ``data``; returns how many bytes."""
        ...

    def sync(self, handle: int) -> None:
        """Return when the bytes written survive a loss of power."""
        ...

    def close(self, handle: int) -> None:
        """Close the handle."""
        ...

    def rename(self, old: Path, new: Path) -> None:
        """Rename a file in one step; it replaces a file that has the new name."""
        ...

    def sync_directory(self, path: Path) -> None:
        """Return when the names in a directory survive a loss of power."""
        ...

    def remove(self, path: Path) -> None:
        """Remove a file."""
        ...


class OsDisk:
    """The operating system's files."""

    def __init__(self, mode: int = PRIVATE) -> None:
        """``mode``: permissions of new files, before the umask."""
        self._mode = mode

    def create(self, path: Path) -> int:
        """See Disk."""
        # With O_NONBLOCK, a pipe of that name is an error instead of a wait.
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
    """Replace a file's content.

    At every moment the file is either the old one or the new one, whole. Raises OSError.
    """
    new = path.with_name(path.name + NEW_SUFFIX)
    try:
        handle = disk.create(new)
        try:
            view = memoryview(data)
            while view:
                view = view[disk.write(handle, bytes(view)) :]
            disk.sync(handle)
        finally:
            disk.close(handle)
        disk.rename(new, path)
    except OSError:
        with contextlib.suppress(OSError):
            disk.remove(new)
        raise
    disk.sync_directory(path.parent)


def write_whole(path: Path, data: bytes) -> None:
    """Replace a file that others may read too (see ``replace_file``). Raises OSError."""
    replace_file(OsDisk(SHARED), path, data)


def beside(path: Path) -> tuple[Path, Path]:
    """Where a file is written until it is whole, and where it then goes; both are the file itself if it is a device.

    The suffix stays, since it decides the format of a picture. Of a symbolic link the file that it leads to is meant.
    """
    target = Path(os.path.realpath(path))
    if os.path.exists(target) and not os.path.isfile(target):
        return path, path  # with its own suffix
    return target.with_name(f".{target.stem}{NEW_SUFFIX}{path.suffix}"), target


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A context that gives a name to write to; what is there in the end takes the place of ``path`` in one step.

    After an error the old file is as it was, and nothing of the new one is left. Raises OSError.
    """
    new, target = beside(path)
    if new == target:
        yield path
        return
    new.unlink(missing_ok=True)  # of a program that was killed
    try:
        yield new
        with new.open("rb") as file:
            os.fsync(file.fileno())  # some disks say only now that they are full
        os.replace(new, target)
    except BaseException:
        with contextlib.suppress(OSError):
            new.unlink(missing_ok=True)
        raise


def set_aside(path: Path, word: str) -> Path:
    """Rename a file to its name plus a word, plus a number if that name is taken; returns the new name.

    Raises OSError.
    """
    place, number = path.with_name(f"{path.name}.{word}"), 2
    while place.exists():
        place, number = path.with_name(f"{path.name}.{word}-{number}"), number + 1
    path.rename(place)
    return place
