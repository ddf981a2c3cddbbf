"""Serial lines: a device that is there, or a pseudo-terminal made here that looks like one to any program."""

from __future__ import annotations

import contextlib
import os
import tty
from pathlib import Path
from typing import Protocol

import serial

from sitl.network.endpoint import READ_BYTES, packets
from sitl.sim_link import SimLink
from sitl.simulator import Simulator

DEFAULT_BAUD, HIGHEST_BAUD = 115200, 4_000_000
RETRY_S = 1.0
TERMINALS = "/dev/pts/"


class Line(Protocol):
    """A serial line: bytes in, bytes out, neither waits."""

    def descriptor(self) -> int | None:
        """The open file; None while the device is away."""
        ...

    def read(self) -> bytes:
        """What has arrived; raises OSError when the device has gone."""
        ...

    def write(self, data: bytes) -> int:
        """Bytes that fitted into the line's buffer; raises OSError when the device has gone."""
        ...

    def reopen(self, now_s: float) -> None:
        """A device that has gone may come back: look for it now and then."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Device:
    """A serial device of the machine, at a speed. It may be pulled out and put in again."""

    def __init__(self, path: str, baud: int) -> None:
        """Raises OSError when it cannot be opened."""
        self._path, self._baud = path, baud
        self._tried_s = 0.0
        self._port: serial.Serial | None = self._opened()

    def _opened(self) -> serial.Serial:
        return serial.Serial(self._path, self._baud, timeout=0, write_timeout=0, exclusive=True)

    def descriptor(self) -> int | None:
        """The open file; None while the device is away."""
        return None if self._port is None else int(self._port.fileno())

    def read(self) -> bytes:
        """What has arrived."""
        return b"" if self._port is None else bytes(self._port.read(READ_BYTES))

    def write(self, data: bytes) -> int:
        """Bytes that fitted into the line's buffer."""
        if self._port is None:
            return len(data)
        try:
            return os.write(self._port.fileno(), data)
        except BlockingIOError:
            return 0

    def reopen(self, now_s: float) -> None:
        """Called when reading or writing failed, and then until it is back."""
        if self._port is not None:
            self._port.close()
            self._port = None
        if now_s - self._tried_s >= RETRY_S:
            self._tried_s = now_s
            with contextlib.suppress(OSError):
                self._port = self._opened()

    def close(self) -> None:
        """Close the device."""
        if self._port is not None:
            self._port.close()


class PseudoTerminal:
    """Both ends of a line: ours, and one that other programs open under the name of a link in the file system."""

    def __init__(self, path: str) -> None:
        """Raises OSError when there is something else of this name, or somebody's terminal that is still there."""
        self._path = Path(path)
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        try:
            name = os.ttyname(self._theirs)
            if _is_left_over(self._path, name):
                self._path.unlink()
            self._path.symlink_to(name)
        except OSError:
            os.close(self._ours)
            os.close(self._theirs)
            raise

    def descriptor(self) -> int:
        """Our end."""
        return self._ours

    def read(self) -> bytes:
        """What was written to the other end."""
        try:
            return os.read(self._ours, READ_BYTES)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Bytes that fitted into the terminal's buffer."""
        try:
            return os.write(self._ours, data)
        except BlockingIOError:
            return 0

    def reopen(self, now_s: float) -> None:
        """It does not go away: we keep the other end open as well."""

    def close(self) -> None:
        """Close both ends and take the name away, if it is still ours."""
        name = os.ttyname(self._theirs)
        if self._path.is_symlink() and os.readlink(self._path) == name:
            self._path.unlink()
        os.close(self._ours)
        os.close(self._theirs)


def _is_left_over(path: Path, own: str) -> bool:
    """Whether a name is that of a simulator that was killed: its terminal has gone, or has just become ours (``own``)."""
    if not path.is_symlink():
        return False
    target = os.readlink(path)
    return target == own or (target.startswith(TERMINALS) and not path.exists())


class SerialEndpoint:
    """One partner at the other end of a line. Nobody there, or too slow: then packets are lost, as on any line."""

    def __init__(self, line: Line, simulator: Simulator, serial_port: int) -> None:
        """The line is open."""
        self._line = line
        self._serial_port = serial_port
        self._link: SimLink = simulator.connect(serial_port, f"serial line {serial_port}")
        self._begun = b""

    def descriptors(self) -> list[int]:
        """The line, unless its device is away."""
        descriptor = self._line.descriptor()
        return [] if descriptor is None else [descriptor]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Bytes in, whole packets out."""
        queued = self._link.take()  # what was said before a restart is still sent: the answer to who asked for it
        if self._link.dropped:
            self._link = simulator.connect(self._serial_port, f"serial line {self._serial_port}")
        try:
            if self._line.descriptor() is None:
                self._line.reopen(now_s)
            self._link.receive(self._line.read())
            self._write(queued)
        except OSError:  # pyserial's errors are of this kind as well
            self._begun = b""
            self._line.reopen(now_s)

    def _write(self, data: bytes) -> None:
        """First the rest of a packet that has begun; what does not fit any more is left out."""
        if self._begun:
            self._begun = self._begun[self._line.write(self._begun) :]
        for packet in packets(data):
            if self._begun:
                return
            written = self._line.write(packet)
            if written == 0:
                return
            self._begun = packet[written:]

    def close(self) -> None:
        """Close the line."""
        self._line.close()
