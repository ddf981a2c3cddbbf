"""MAVLink over TCP, as client or as server, with reconnection."""

from __future__ import annotations

import errno
import os
import select
import socket

from companion.core.clock import Clock
from companion.mavlink.byte_link import MAX_READ_BYTES, BackOff, OutBuffer
from companion.mavlink.udp import cannot_listen, resolve

CONNECT_TIMEOUT_S = 5.0
UNACKNOWLEDGED_LIMIT_MS = 5000
"""A connection is dropped when the peer has acknowledged nothing for this long."""


class _Stream:
    """One connected, non-blocking socket. ``ok`` becomes False when the peer has gone."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_LIMIT_MS)
        self._socket = connection
        self._out = OutBuffer()
        self.ok = True

    def read(self) -> bytes:
        self._flush()
        try:
            data = self._socket.recv(MAX_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            self.ok = False
            return b""
        self.ok = self.ok and bool(data)
        return data

    def write(self, data: bytes) -> None:
        self._out.add(data)
        self._flush()

    def close(self) -> None:
        self._socket.close()

    def _flush(self) -> None:
        if not self._out.waiting:
            return
        try:
            self._out.taken(self._socket.send(self._out.waiting))
        except BlockingIOError:
            return
        except OSError:
            self.ok = False


class TcpLink:
    """A client that connects by itself, with growing pauses between attempts; only the name look-up may block."""

    def __init__(self, host: str, port: int, clock: Clock) -> None:
        self._name = f"tcp:{host}:{port}"
        self._family, self._address = resolve(host, port, socket.SOCK_STREAM, self._name)
        self._clock = clock
        self._back_off = BackOff()
        self._connecting: socket.socket | None = None
        self._refused = ""
        """Why the last attempt failed, in the system's words."""
        self._began_s = 0.0
        self._stream: _Stream | None = None
        self._closed = False
        self._connect()

    @property
    def description(self) -> str:
        """The link in words."""
        why = f": {self._refused}" if self._refused else ""
        return self._name if self.connected else f"{self._name} (not connected{why})"

    @property
    def connected(self) -> bool:
        """Whether there is a peer."""
        return self._stream is not None

    def read(self) -> bytes:
        """The bytes that have arrived; also connects again."""
        if self._stream is None:
            self._connect()
            if self._stream is None:
                return b""
        data = self._stream.read()
        self._drop_if_gone()
        return data

    def write(self, data: bytes) -> None:
        """Send; bytes are dropped while there is no peer."""
        if self._stream is not None:
            self._stream.write(data)
            self._drop_if_gone()

    def close(self) -> None:
        """Close the connection for good."""
        self._closed = True
        for connection in (self._connecting, self._stream):
            if connection is not None:
                connection.close()
        self._connecting = self._stream = None

    def _drop_if_gone(self) -> None:
        if self._stream is not None and not self._stream.ok:
            self._stream.close()
            self._stream = None

    def _connect(self) -> None:
        """Start a connection, or see whether it is established."""
        now_s = self._clock.now_s()
        if self._connecting is None:
            if self._closed or not self._back_off.due(now_s):
                return
            self._connecting = socket.socket(self._family, socket.SOCK_STREAM)
            self._connecting.setblocking(False)
            self._note_error(self._connecting.connect_ex(self._address))
            self._began_s = now_s
        _, writable, _ = select.select([], [self._connecting], [], 0)
        error = self._connecting.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) if writable else 0
        self._note_error(error)
        if writable and error == 0 and self._is_up():
            self._stream = _Stream(self._connecting)
            self._connecting, self._refused = None, ""
            self._back_off.reset()
        elif writable or now_s - self._began_s > CONNECT_TIMEOUT_S:
            self._refused = self._refused if writable else "no answer"
            self._connecting.close()
            self._connecting = None

    def _note_error(self, error: int) -> None:
        if error not in (0, errno.EINPROGRESS):
            self._refused = os.strerror(error).lower()

    def _is_up(self) -> bool:
        """Whether there is a peer: a refused connection is writable too, and its error may have been fetched before."""
        assert self._connecting is not None
        try:
            return self._connecting.getpeername() is not None
        except OSError:
            return False


class TcpServerLink:
    """A server that serves the newest connection: a restarted autopilot replaces its old one.

    Raises LinkError when the port is taken.
    """

    def __init__(self, host: str, port: int) -> None:
        self._name = f"tcpin:{host}:{port}"
        family, address = resolve(host, port, socket.SOCK_STREAM, self._name)
        self._listener = socket.socket(family, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.setblocking(False)
        self._stream: _Stream | None = None
        try:
            self._listener.bind(address)
            self._listener.listen(1)
        except OSError as error:
            self._listener.close()
            raise cannot_listen(self._name, error, "tcp", port) from error

    @property
    def description(self) -> str:
        """The link in words."""
        return self._name if self.connected else f"{self._name} (nobody is connected)"

    @property
    def connected(self) -> bool:
        """Whether there is a peer."""
        return self._stream is not None

    @property
    def port(self) -> int:
        """The local port, which matters if 0 was given."""
        return int(self._listener.getsockname()[1])

    def read(self) -> bytes:
        """The bytes that have arrived; also accepts a new connection."""
        try:
            connection, _ = self._listener.accept()
        except OSError:
            connection = None
        if connection is not None:
            self._drop()
            self._stream = _Stream(connection)
        if self._stream is None:
            return b""
        data = self._stream.read()
        if not self._stream.ok:
            self._drop()
        return data

    def write(self, data: bytes) -> None:
        """Send; bytes are dropped while nobody is connected."""
        if self._stream is not None:
            self._stream.write(data)
            if not self._stream.ok:
                self._drop()

    def close(self) -> None:
        """Close the connection and stop listening."""
        self._drop()
        self._listener.close()

    def _drop(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None
