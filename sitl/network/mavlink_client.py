"""A line to a MAVLink network where somebody else listens: TCP that connects again whenever it has to, or UDP."""

from __future__ import annotations

import contextlib
import math
import socket
from typing import Protocol

from sitl.network.endpoint import READ_BYTES, ListenError, network_address, place_text

RETRY_S = 1.0
CONNECT_S = 0.2
"""A computer that does not answer is not waited for longer."""
BACKLOG_BYTES = 65536
"""Somebody who does not read is hung up on when so much is waiting for him."""
FORMS = "tcp:HOST:PORT, udpout:HOST:PORT or udpin:HOST:PORT"


class ClientLink(Protocol):
    """Bytes to and from the network; what cannot be sent is lost."""

    @property
    def peer(self) -> str:
        """Who is at the other end; empty for nobody."""
        ...

    def sockets(self) -> list[socket.socket]:
        """What to wait on for input."""
        ...

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Send some bytes, whole packets; return what has arrived. ``now_s``: real seconds."""
        ...

    def close(self) -> None:
        """Let go of all sockets."""
        ...


def open_link(url: str) -> ClientLink:
    """Open one of ``FORMS``. Raises ListenError."""
    host, port = network_address(url, FORMS)
    listens = url.startswith("udpin")
    try:
        if url.startswith("tcp"):
            return TcpLink((socket.gethostbyname(host), port))
        return UdpLink(host, port, listens=listens)
    except (OSError, UnicodeError) as error:
        remedy = "choose another port" if listens else "is that a computer's name or address?"
        raise ListenError(f"{url}: cannot be opened: {getattr(error, 'strerror', None) or error}; {remedy}") from error


class UdpLink:
    """One UDP partner: a fixed one (udpout) or whoever spoke last (udpin)."""

    def __init__(self, host: str, port: int, *, listens: bool) -> None:
        """Raises OSError when the address cannot be used."""
        self._partner: tuple[str, int] | None = None if listens else (socket.gethostbyname(host), port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port) if listens else ("", 0))
        except OSError:
            self._socket.close()
            raise

    @property
    def peer(self) -> str:
        """Who is sent to, there or not; empty before anybody has spoken."""
        return "" if self._partner is None else place_text(self._partner)

    def sockets(self) -> list[socket.socket]:
        """The one socket."""
        return [self._socket]

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """An absent partner is no error."""
        heard = b""
        with contextlib.suppress(OSError):
            while True:
                datagram, self._partner = self._socket.recvfrom(READ_BYTES)
                heard += datagram
        if data and self._partner is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._partner)
        return heard

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpLink:
    """A TCP client. The firmware hangs up when it restarts."""

    def __init__(self, place: tuple[str, int]) -> None:
        """Connects with the first exchange."""
        self._place = place
        self._socket: socket.socket | None = None
        self._waiting = bytearray()
        self._next_try_s = -math.inf

    @property
    def peer(self) -> str:
        """The other side, while there is a connection."""
        return place_text(self._place) if self._socket else ""

    def sockets(self) -> list[socket.socket]:
        """The one socket, while there is a connection."""
        return [self._socket] if self._socket else []

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Connects if there is no connection, once a second at most; ``data`` is lost then."""
        if self._socket is None:
            self._connect(now_s)
        if self._socket is None:
            return b""
        heard = b""
        self._waiting += data
        try:
            heard = self._received(self._socket)
            self._send(self._socket)
        except OSError:
            self.close()
        return heard

    def close(self) -> None:
        """Hang up."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self._waiting.clear()

    def _connect(self, now_s: float) -> None:
        if now_s < self._next_try_s:
            return
        self._next_try_s = now_s + RETRY_S
        with contextlib.suppress(OSError):
            self._socket = socket.create_connection(self._place, timeout=CONNECT_S)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setblocking(False)

    def _received(self, connection: socket.socket) -> bytes:
        heard = b""
        with contextlib.suppress(BlockingIOError):
            while data := connection.recv(READ_BYTES):
                heard += data
            raise ConnectionResetError("the other side has hung up")
        return heard

    def _send(self, connection: socket.socket) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._waiting:
                del self._waiting[: connection.send(self._waiting)]
        if len(self._waiting) > BACKLOG_BYTES:
            raise ConnectionAbortedError("the other side does not read")
