"""The files that people name: only what is a file is opened, because a pipe would keep the program waiting and a device has no end."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path


def open_file(path: Path) -> BufferedReader:
    """An ordinary file, open for reading. Raises OSError, also for a pipe, a socket or a device; never waits for another program."""
    # Without O_NONBLOCK to open a pipe is to wait for somebody who writes into it.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "not a file", str(path))


def read_at_most(path: Path, limit: int) -> bytes:
    """A whole ordinary file. Raises OSError, also if it has more bytes than ``limit``, before they take any memory."""
    with open_file(path) as file:
        if os.fstat(file.fileno()).st_size > limit:
            raise OSError(errno.EFBIG, f"larger than {limit} bytes", str(path))
        return file.read(limit)


def refuse_pipe(path: Path) -> None:
    """To be asked before a file is written. Raises OSError if there is a pipe, a socket or a disk; what is not there yet is fine."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or stat.S_ISBLK(mode):
        raise OSError(errno.EINVAL, "not a file", str(path))


def why_no_file(path: Path) -> str:
    """Why a name is not that of an ordinary file, and what to do; empty if it is."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return "no such file; check the path"
    except OSError as error:
        return f"cannot be read: {error.strerror}; check the path"
    if stat.S_ISREG(mode):
        return ""
    return "is a folder, not a file; add a file's name" if stat.S_ISDIR(mode) else "not a file; name one"
