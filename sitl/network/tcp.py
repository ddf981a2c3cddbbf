"""TCP server endpoint: a port to which several clients may connect."""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass, field

from sitl.network.endpoint import BACKLOG_BYTES, READ_BYTES, place_text
from sitl.network.event_log import EventLog
from sitl.sim_link import SimLink
from sitl.simulator import Simulator

MOST_CLIENTS = 32
MOST_READS = 16
"""Reads per round and client; more must wait, so that a flood does not stop the vehicle."""


@dataclass
class TcpClient:
    """A connected client, its link, and bytes that it has not read yet."""

    socket: socket.socket
    link: SimLink
    name: str
    waiting: bytearray = field(default_factory=bytearray)
    gone: bool = False

    def exchange(self) -> None:
        """Read what has arrived, write what fits."""
        self._read()
        self.waiting += self.link.take()
        try:
            while self.waiting:
                sent = self.socket.send(self.waiting)
                del self.waiting[:sent]
        except BlockingIOError:
            self.gone |= len(self.waiting) > BACKLOG_BYTES
        except OSError:
            self.gone = True

    def _read(self) -> None:
        try:
            for _ in range(MOST_READS):
                data = self.socket.recv(READ_BYTES)
                if not data:
                    self.gone = True
                    return
                self.link.receive(data)
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True


class TcpServer:
    """Listens on one port; every client has its own link."""

    def __init__(self, host: str, port: int, log: EventLog, serial_port: int) -> None:
        """Raises OSError when the port is in use."""
        self._url = f"tcp:{host}:{port}"
        self._log = log
        self._serial_port = serial_port
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

    def descriptors(self) -> list[int]:
        """The listener and all clients."""
        listener = [self._socket.fileno()] if len(self._clients) < MOST_CLIENTS else []
        return listener + [client.socket.fileno() for client in self._clients]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Accept new clients, serve all, remove those that disconnected."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while len(self._clients) < MOST_CLIENTS:
                caller, place = self._socket.accept()
                caller.setblocking(False)
                caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                name = place_text(place)
                link = simulator.connect(self._serial_port, f"tcp:{name}")
                self._clients.append(TcpClient(caller, link, name))
                self._log.connected(self._clients[-1].name, self._url)
        for client in self._clients:
            client.exchange()
            if client.gone or client.link.dropped:
                self._log.disconnected(client.name, self._url, dropped=not client.gone)
                simulator.disconnect(client.link)
                client.socket.close()
        self._clients = [client for client in self._clients if not (client.gone or client.link.dropped)]

    def close(self) -> None:
        """Close the listener and every client."""
        for client in self._clients:
            client.socket.close()
        self._socket.close()
