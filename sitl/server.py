"""Bytes between a simulator and the network: UDP and TCP, clients that come and go, in real time or faster."""

from __future__ import annotations

import contextlib
import errno
import select
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from sitl.news import News
from sitl.simulator import SimLink, Simulator

STEP_S = 0.02
READ_BYTES = 65536
DATAGRAM_BYTES = 1400
MAVLINK_2, SIGNED = 0xFD, 1
BACKLOG_BYTES = 1_000_000
"""A TCP client that does not read is dropped when so much is waiting for it."""
LATE_S = 1.0
"""When the machine cannot keep up, the clock is moved by what is later than this."""


class ListenError(Exception):
    """An address that cannot be used; the text is one line."""


class Endpoint(Protocol):
    """Something that exchanges bytes with the simulator."""

    def sockets(self) -> list[socket.socket]:
        """What to wait on for input."""
        ...

    def exchange(self, simulator: Simulator) -> None:
        """Take in what arrived and send what is queued; never blocks."""
        ...

    def close(self) -> None:
        """Let go of all sockets."""
        ...


def _address(url: str) -> tuple[str, str, int]:
    kind, _, place = url.partition(":")
    host, _, port = place.rpartition(":")
    if kind not in ("tcp", "udpout", "udpin") or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise ListenError(f"{url}: not an address; write tcp:HOST:PORT, udpout:HOST:PORT or udpin:HOST:PORT")
    return kind, host, int(port)


def open_endpoint(url: str, simulator: Simulator, news: News | None = None) -> Endpoint:
    """Open ``tcp:HOST:PORT`` (listens), ``udpout:HOST:PORT`` (sends) or ``udpin:HOST:PORT`` (waits). Raises ListenError."""
    kind, host, port = _address(url)
    news = news or News()
    try:
        if kind == "tcp":
            return TcpServer(host, port, news)
        return UdpEndpoint(host, port, listens=kind == "udpin", link=simulator.connect(), news=news)
    except OSError as error:
        remedy = "choose another port" if error.errno == errno.EADDRINUSE else "is that an address of this computer?"
        raise ListenError(f"{url}: cannot be opened: {error.strerror or error}; {remedy}") from error


def place_text(place: tuple[str, int]) -> str:
    """An address of the other side as people write it."""
    return f"{place[0]}:{place[1]}"


def datagrams(data: bytes) -> list[bytes]:
    """The same bytes in pieces of whole packets, as many as fit into one datagram; a damaged header may put the cuts elsewhere."""
    pieces, start, at = [], 0, 0
    while at + 2 < len(data):
        size = data[at + 1] + (12 if data[at] == MAVLINK_2 else 8)
        if data[at] == MAVLINK_2 and data[at + 2] & SIGNED:
            size += 13
        if at + size - start > DATAGRAM_BYTES and at > start:
            pieces.append(data[start:at])
            start = at
        at += size
    if start < len(data):
        pieces.append(data[start:])
    return pieces


class UdpEndpoint:
    """One UDP partner: a fixed one (udpout) or whoever spoke last (udpin)."""

    def __init__(self, host: str, port: int, listens: bool, link: SimLink, news: News) -> None:
        """Raises OSError when the address cannot be used."""
        self._url = f"{'udpin' if listens else 'udpout'}:{host}:{port}"
        self._news = news
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._link = link
        self._partner: tuple[str, int] | None = None
        try:
            if listens:
                self._socket.bind((host, port))
            else:
                self._partner = (socket.gethostbyname(host), port)
                self._socket.bind(("", 0))
        except OSError:
            self._socket.close()
            raise

    def sockets(self) -> list[socket.socket]:
        """The one socket."""
        return [self._socket]

    def exchange(self, simulator: Simulator) -> None:
        """Datagrams in and out; an absent partner is no error."""
        while True:
            try:
                data, self._partner = self._socket.recvfrom(READ_BYTES)
            except BlockingIOError:
                break
            except OSError:  # the partner's port is closed; it may open again
                continue
            self._news.heard(place_text(self._partner), self._url)
            self._link.receive(data)
        if self._link.dropped:
            self._link = simulator.connect()
        for piece in datagrams(self._link.take()):
            if self._partner is not None:
                with contextlib.suppress(OSError):
                    self._socket.sendto(piece, self._partner)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


@dataclass
class TcpClient:
    """A connected client, its link and what it has not read yet."""

    socket: socket.socket
    link: SimLink
    name: str
    waiting: bytearray = field(default_factory=bytearray)
    gone: bool = False

    def exchange(self) -> None:
        """Read all there is, write what fits."""
        try:
            while data := self.socket.recv(READ_BYTES):
                self.link.receive(data)
            self.gone = True
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True
        self.waiting += self.link.take()
        try:
            while self.waiting:
                sent = self.socket.send(self.waiting)
                del self.waiting[:sent]
        except BlockingIOError:
            self.gone |= len(self.waiting) > BACKLOG_BYTES
        except OSError:
            self.gone = True


class TcpServer:
    """Listens on one port; every client has a link of its own."""

    def __init__(self, host: str, port: int, news: News) -> None:
        """Raises OSError when the port is in use."""
        self._url = f"tcp:{host}:{port}"
        self._news = news
        self._clients: list[TcpClient] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((host, port))
            self._socket.listen()
            self._socket.setblocking(False)
        except OSError:
            self._socket.close()
            raise

    def sockets(self) -> list[socket.socket]:
        """The listener and all clients."""
        return [self._socket, *(client.socket for client in self._clients)]

    def exchange(self, simulator: Simulator) -> None:
        """Let new clients in, serve the others, forget those that left."""
        with contextlib.suppress(BlockingIOError):
            while True:
                caller, place = self._socket.accept()
                caller.setblocking(False)
                caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._clients.append(TcpClient(caller, simulator.connect(), place_text(place)))
                self._news.came(self._clients[-1].name, self._url)
        for client in self._clients:
            client.exchange()
            if client.gone or client.link.dropped:
                self._news.left(client.name, self._url, dropped=not client.gone)
                simulator.disconnect(client.link)
                client.socket.close()
        self._clients = [client for client in self._clients if not (client.gone or client.link.dropped)]

    def close(self) -> None:
        """Close the listener and every client."""
        for client in self._clients:
            client.socket.close()
        self._socket.close()


def serve(
    simulator: Simulator,
    endpoints: list[Endpoint],
    now_s: Callable[[], float],
    speedup: float,
    running: Callable[[], bool],
    news: News | None = None,
) -> None:
    """Keep the simulator ``speedup`` times as fast as ``now_s`` (real seconds) until ``running`` says no; ``news`` tells of it."""
    news = news or News()
    began_s = now_s() - simulator.time_s / speedup
    while running():
        for endpoint in endpoints:
            endpoint.exchange(simulator)
        goal_s = (now_s() - began_s) * speedup
        if goal_s - simulator.time_s > LATE_S * max(speedup, 1.0):
            began_s += (goal_s - simulator.time_s) / speedup
            goal_s = simulator.time_s + STEP_S
        simulator.advance_to_s(goal_s)
        for endpoint in endpoints:
            endpoint.exchange(simulator)
        news.look(simulator)
        wait_s = (simulator.time_s + STEP_S) / speedup + began_s - now_s()
        if wait_s > 0.0:
            sockets = [one for endpoint in endpoints for one in endpoint.sockets()]
            select.select(sockets, [], [], wait_s)
