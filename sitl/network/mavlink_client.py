"""Client links to a MAVLink network: TCP that reconnects when needed, or UDP."""

from __future__ import annotations

import contextlib
import math
import socket
from typing import Protocol

from sitl.network.endpoint import READ_BYTES, ListenError, network_address, place_text

RETRY_S = 1.0
CONNECT_S = 0.2
"""Timeout of a connection attempt."""
BACKLOG_BYTES = 65536
"""The connection is closed when this much waits for a peer that does not read."""
FORMS = "tcp:HOST:PORT, udpout:HOST:PORT or udpin:HOST:PORT"


class ClientLink(Protocol):
    """A link to the network; bytes that cannot be sent are lost."""

    @property
    def peer(self) -> str:
        """Address of the other end; empty if there is none."""
        ...

    def sockets(self) -> list[socket.socket]:
        """Sockets to wait on for input."""
        ...

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Send bytes (complete packets) and return what has arrived. ``now_s``: real seconds."""
        ...

    def close(self) -> None:
        """Close all sockets."""
        ...


def open_link(url: str) -> ClientLink:
    """Open an address of one of the ``FORMS``. Raises ListenError."""
    host, port = network_address(url, FORMS)
    listens = url.startswith("udpin")
    try:
        if url.startswith("tcp"):
            return TcpLink((socket.gethostbyname(host), port))
        return UdpLink(host, port, listens=listens)
    except (OSError, UnicodeError) as error:
        remedy = "choose another port" if listens else "is that the name or address of a computer?"
        raise ListenError(f"{url}: cannot be opened: {getattr(error, 'strerror', None) or error}; {remedy}") from error


class UdpLink:
    """A UDP link to a fixed peer (udpout), or to the last sender (udpin)."""

    def __init__(self, host: str, port: int, *, listens: bool) -> None:
        """Raises OSError when the address cannot be used."""
        self._peer: tuple[str, int] | None = None if listens else (socket.gethostbyname(host), port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port) if listens else ("", 0))
        except OSError:
            self._socket.close()
            raise

    @property
    def peer(self) -> str:
        """The peer, present or not; empty before one has sent anything."""
        return "" if self._peer is None else place_text(self._peer)

    def sockets(self) -> list[socket.socket]:
        """The one socket."""
        return [self._socket]

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Send and receive; an absent peer is not an error."""
        heard = b""
        with contextlib.suppress(OSError):
            while True:
                datagram, self._peer = self._socket.recvfrom(READ_BYTES)
                heard += datagram
        if data and self._peer is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._peer)
        return heard

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpLink:
    """A TCP client that reconnects. The firmware closes the connection when it restarts."""

    def __init__(self, place: tuple[str, int]) -> None:
        """Connects with the first exchange."""
        self._place = place
        self._socket: socket.socket | None = None
        self._waiting = bytearray()
        self._next_try_s = -math.inf

    @property
    def peer(self) -> str:
        """The peer, while connected."""
        return place_text(self._place) if self._socket else ""

    def sockets(self) -> list[socket.socket]:
        """The socket, while connected."""
        return [self._socket] if self._socket else []

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Send and receive; without a connection, try to connect at most once a second, and drop ``data``."""
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
        """Close the connection."""
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
            raise ConnectionResetError("the peer has closed the connection")
        return heard

    def _send(self, connection: socket.socket) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._waiting:
                del self._waiting[: connection.send(self._waiting)]
        if len(self._waiting) > BACKLOG_BYTES:
            raise ConnectionAbortedError("the peer does not read")
