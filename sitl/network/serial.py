"""Serial lines: an existing device, or a pseudo-terminal that other programs open like one."""

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
    """A serial line, read and written without blocking."""

    def descriptor(self) -> int | None:
        """The file descriptor; None while the device is missing."""
        ...

    def read(self) -> bytes:
        """The bytes that have arrived. Raises OSError when the device is gone."""
        ...

    def write(self, data: bytes) -> int:
        """Write, and return the number of bytes that fitted into the buffer. Raises OSError when the device is gone."""
        ...

    def reopen(self, now_s: float) -> None:
        """Try to open a missing device again, from time to time."""
        ...

    def close(self) -> None:
        """Close the line."""
        ...


class Device:
    """A serial device, at a baud rate. It may be unplugged and plugged in again."""

    def __init__(self, path: str, baud: int) -> None:
        """Raises OSError when it cannot be opened."""
        self._path, self._baud = path, baud
        self._tried_s = 0.0
        self._port: serial.Serial | None = self._opened()

    def _opened(self) -> serial.Serial:
        return serial.Serial(self._path, self._baud, timeout=0, write_timeout=0, exclusive=True)

    def descriptor(self) -> int | None:
        """The file descriptor; None while the device is missing."""
        return None if self._port is None else int(self._port.fileno())

    def read(self) -> bytes:
        """The bytes that have arrived."""
        return b"" if self._port is None else bytes(self._port.read(READ_BYTES))

    def write(self, data: bytes) -> int:
        """Write, and return the number of bytes that fitted into the buffer."""
        if self._port is None:
            return len(data)
        try:
            return os.write(self._port.fileno(), data)
        except BlockingIOError:
            return 0

    def reopen(self, now_s: float) -> None:
        """Close the device and try to open it again; called until it is back."""
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
    """A pseudo-terminal; other programs open its far end through a symbolic link."""

    def __init__(self, path: str) -> None:
        """Raises OSError if the name is taken, for instance by a terminal that is still in use."""
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
        """File descriptor of the near end."""
        return self._ours

    def read(self) -> bytes:
        """The bytes written to the far end."""
        try:
            return os.read(self._ours, READ_BYTES)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Write, and return the number of bytes that fitted into the buffer."""
        try:
            return os.write(self._ours, data)
        except BlockingIOError:
            return 0

    def reopen(self, now_s: float) -> None:
        """Nothing to do: the far end is kept open here too, so it never goes away."""

    def close(self) -> None:
        """Close both ends and remove the link, if it is still ours."""
        name = os.ttyname(self._theirs)
        if self._path.is_symlink() and os.readlink(self._path) == name:
            self._path.unlink()
        os.close(self._ours)
        os.close(self._theirs)


def _is_left_over(path: Path, own: str) -> bool:
    """Whether a link was left by a killed simulator: its terminal is gone, or has just become ours (``own``)."""
    if not path.is_symlink():
        return False
    target = os.readlink(path)
    return target == own or (target.startswith(TERMINALS) and not path.exists())


class SerialEndpoint:
    """One client at the other end of a line. If it is absent or too slow, packets are lost, as on any serial line."""

    def __init__(self, line: Line, simulator: Simulator, serial_port: int) -> None:
        """``line`` must be open."""
        self._line = line
        self._serial_port = serial_port
        self._link: SimLink = simulator.connect(serial_port, f"serial line {serial_port}")
        self._begun = b""

    def descriptors(self) -> list[int]:
        """The line, unless its device is missing."""
        descriptor = self._line.descriptor()
        return [] if descriptor is None else [descriptor]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Receive bytes, send complete packets."""
        queued = self._link.take()  # packets from before a restart are still sent: they contain the acknowledgement
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
        """Write the rest of a packet that was begun, then whole packets; what does not fit is dropped."""
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
