"""MAVLink over a serial port, with reconnection of an unplugged adapter."""

from __future__ import annotations

import errno
import termios

import serial

from companion.core.clock import Clock
from companion.mavlink import port_users
from companion.mavlink.byte_link import MAX_READ_BYTES, BackOff, ByteLink, LinkError, OutBuffer
from companion.mavlink.port_users import PortUser, in_words

REASONS = {
    errno.ENOENT: "there is no such device; check the cable and `ls /dev/tty*`",
    errno.EISDIR: "it is a directory, no serial port; see `ls /dev/tty*`",
    errno.EACCES: "no permission; add yourself to the group 'dialout'",
    errno.EPERM: "no permission; add yourself to the group 'dialout'",
}
"""Why a port cannot be opened, and the remedy."""
IN_USE = (errno.EAGAIN, errno.EBUSY)
SHARE = "docs/ports.md says how several programs share one port"


class SerialLink:
    """A serial port, 8N1 without flow control.

    Raises LinkError if it cannot be opened first; later it opens again by itself.
    """

    def __init__(self, device: str, baud: int, clock: Clock) -> None:
        self._device = device
        self._baud = baud
        self._clock = clock
        self._back_off = BackOff(first_s=1.0)
        self._out = OutBuffer()
        self._closed = False
        self._port: serial.Serial | None = None
        try:
            self._port = self._open()
        except (OSError, ValueError, OverflowError) as error:
            raise LinkError(f"{self._name}: cannot be opened: {open_reason(error, device)}") from error

    @property
    def _name(self) -> str:
        return f"serial:{self._device}:{self._baud}"

    @property
    def description(self) -> str:
        """The link in words."""
        return self._name if self.connected else f"{self._name} (not there)"

    @property
    def connected(self) -> bool:
        """Whether the device is there."""
        return self._port is not None

    @property
    def rivals(self) -> tuple[PortUser, ...]:
        """The other programs that have the device open now: each takes bytes away from the others."""
        return port_users.of_device(self._device)

    def read(self) -> bytes:
        """The bytes that have arrived; opens the port again if it was lost."""
        if self._port is None and not self._reopen():
            return b""
        assert self._port is not None
        try:
            self._flush()
            return bytes(self._port.read(MAX_READ_BYTES))
        except (OSError, TypeError):
            # pyserial fails with a TypeError when the port is lost between two of its own calls.
            self._lose()
            return b""

    def write(self, data: bytes) -> None:
        """Send; bytes are dropped while the port is missing."""
        if self._port is None:
            return
        self._out.add(data)
        try:
            self._flush()
        except (OSError, TypeError):
            self._lose()

    def close(self) -> None:
        """Close the port for good."""
        self._closed = True
        self._lose()

    def _open(self) -> serial.Serial:
        return serial.Serial(self._device, self._baud, timeout=0, write_timeout=0, exclusive=True)

    def _reopen(self) -> bool:
        if self._closed or not self._back_off.due(self._clock.now_s()):
            return False
        try:
            self._port = self._open()
        except (OSError, ValueError):
            return False
        self._back_off.reset()
        return True

    def _flush(self) -> None:
        assert self._port is not None
        if self._out.waiting:
            try:
                self._out.taken(int(self._port.write(bytes(self._out.waiting)) or 0))
            except serial.SerialTimeoutException:
                return  # the port's buffer is full

    def _lose(self) -> None:
        self._out.clear()
        if self._port is not None:
            self._port.close()
            self._port = None


def rivals_of(link: ByteLink) -> tuple[PortUser, ...]:
    """The other programs that have the link's device open; none for links without a device."""
    return link.rivals if isinstance(link, SerialLink) else ()


def open_reason(error: Exception, device: str) -> str:
    """pyserial's error in words, with the remedy."""
    if isinstance(error, OSError) and error.errno in IN_USE:
        return f"{in_words(port_users.of_device(device))} uses it; stop that one ({SHARE})"
    if isinstance(error, OSError) and error.errno in REASONS:
        return REASONS[error.errno]
    if isinstance(error, ValueError | OverflowError):
        return f"the port does not take this baud rate ({error})"
    if isinstance(error.__context__, termios.error):  # pyserial hands on neither it nor its number
        return "it is no serial port; see `ls /dev/tty*`"
    return f"{error}; check the device"
