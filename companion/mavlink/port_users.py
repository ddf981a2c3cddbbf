"""Which other programs have a serial device or a listening port open, as Linux tells it in /proc.

A program of another user shows its files to root only, so what is not found may be there all the same.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")
LISTENING = {"tcp": "0A", "udp": "07"}
"""The state in /proc/net of a socket that takes what comes."""
TERMINAL_MAJORS = range(136, 144)
"""Device numbers of pseudo-terminals (/dev/pts)."""
MASTER = "/dev/ptmx"
INTERPRETERS = re.compile(r"(python|pypy)[0-9.]*$")
SHOWN = 40


@dataclass(frozen=True, slots=True)
class PortUser:
    """A program that has a port open."""

    program: str
    pid: int

    def __str__(self) -> str:
        """The program in words."""
        return f"{self.program} (process {self.pid})"


def of_device(path: str, proc: Path = PROC) -> tuple[PortUser, ...]:
    """The other programs that have this serial device open; none if there is no such device.

    Who keeps the other side of a pseudo-terminal is its wire, not a user.
    """
    try:
        device = os.stat(path)
    except (OSError, ValueError):
        return ()
    if not stat.S_ISCHR(device.st_mode):
        return ()
    number = device.st_rdev

    def is_it(file: Path) -> bool:
        with contextlib.suppress(OSError):
            found = os.stat(file)
            return stat.S_ISCHR(found.st_mode) and found.st_rdev == number
        return False

    users = (user for user, files in _processes(proc) if any(map(is_it, files)) and not _is_wire(user, number, proc))
    return tuple(users)


def of_port(kind: str, port: int, proc: Path = PROC) -> tuple[PortUser, ...]:
    """The other programs that listen on a network port; ``kind``: tcp or udp."""
    sockets = {f"socket:[{inode}]" for inode in _listening(kind, port, proc)}

    def is_it(file: Path) -> bool:
        with contextlib.suppress(OSError):
            return os.readlink(file) in sockets
        return False

    return tuple(user for user, files in _processes(proc) if any(map(is_it, files))) if sockets else ()


def same_device(one: str, other: str) -> bool:
    """Whether two names are of one device: below /dev/serial/by-id every port has a second name."""
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    with contextlib.suppress(OSError, ValueError):
        files = os.stat(one), os.stat(other)
        return all(stat.S_ISCHR(file.st_mode) for file in files) and files[0].st_rdev == files[1].st_rdev
    return False


def in_words(users: tuple[PortUser, ...]) -> str:
    """The programs as part of a sentence; "another program" if none is known."""
    return " and ".join(map(str, users)) or "another program"


def _processes(proc: Path) -> Iterator[tuple[PortUser, list[Path]]]:
    """Every other process with its open files, as far as they may be seen."""
    numbers = sorted(int(folder.name) for folder in proc.iterdir() if folder.name.isdigit())
    for pid in numbers:
        if pid == os.getpid():
            continue
        with contextlib.suppress(OSError):  # it has ended, or belongs to somebody else
            files = list((proc / str(pid) / "fd").iterdir())
            yield PortUser(_program(proc / str(pid)), pid), files


def _program(folder: Path) -> str:
    """What a process is called by people: of an interpreter the script or module that it runs."""
    words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
    name = os.path.basename(words[0])
    if INTERPRETERS.match(name):
        if "-m" in words[:-1]:
            name = words[words.index("-m") + 1]
        else:
            name = next((os.path.basename(word) for word in words[1:] if word and not word.startswith("-")), name)
    printable = "".join(letter for letter in name if letter.isprintable())
    return printable[:SHOWN] or (folder / "comm").read_text(errors="replace").strip()


def _is_wire(user: PortUser, number: int, proc: Path) -> bool:
    """Whether a process keeps the other side of the pseudo-terminal with this device number."""
    if os.major(number) not in TERMINAL_MAJORS:
        return False
    index = os.minor(number) + 256 * (os.major(number) - TERMINAL_MAJORS[0])
    with contextlib.suppress(OSError):
        for file in (proc / str(user.pid) / "fd").iterdir():
            if os.readlink(file) not in (MASTER, "/dev/pts/ptmx"):
                continue
            told = (proc / str(user.pid) / "fdinfo" / file.name).read_text()
            if re.search(rf"^tty-index:\s*{index}$", told, re.MULTILINE):
                return True
    return False


def _listening(kind: str, port: int, proc: Path) -> Iterator[str]:
    """The inodes of sockets that listen on a port, of both families."""
    for table in (kind, f"{kind}6"):
        with contextlib.suppress(OSError):
            for line in (proc / "net" / table).read_text().splitlines()[1:]:
                words = line.split()
                if int(words[1].rpartition(":")[2], 16) == port and words[3] == LISTENING[kind]:
                    yield words[9]
