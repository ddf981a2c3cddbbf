"""UDP endpoint: one client to send to (udpout), or all clients that send to a port (udpin)."""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass

from sitl.network.endpoint import READ_BYTES, datagrams, place_text
from sitl.network.event_log import EventLog
from sitl.sim_link import SimLink
from sitl.simulator import Simulator

Address = tuple[str, int]
MOST_CLIENTS = 8
SILENT_S = 30.0
"""A client that has been silent for this long is forgotten if there are others."""
MOST_DATAGRAMS = 1000
"""Datagrams per round; more must wait, so that a flood does not stop the vehicle."""


@dataclass
class UdpClient:
    """A client and its link."""

    link: SimLink
    heard_s: float


class UdpEndpoint:
    """Every client has its own link; with ``listens`` any client may send, else there is just one."""

    def __init__(
        self, host: str, port: int, listens: bool, simulator: Simulator, log: EventLog, serial_port: int
    ) -> None:
        """Raises OSError when the address cannot be used."""
        self._url = f"{'udpin' if listens else 'udpout'}:{host}:{port}"
        self._log = log
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._listens = listens
        self._serial_port = serial_port
        self._clients: dict[Address, UdpClient] = {}
        try:
            if listens:
                self._socket.bind((host, port))
            else:
                address = (socket.gethostbyname(host), port)
                self._socket.bind(("", 0))
                self._clients[address] = UdpClient(simulator.connect(serial_port, f"udp:{place_text(address)}"), 0.0)
        except OSError:
            self._socket.close()
            raise

    def descriptors(self) -> list[int]:
        """The socket."""
        return [self._socket.fileno()]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Receive and send datagrams; an absent client is not an error."""
        for _ in range(MOST_DATAGRAMS):
            try:
                data, sender = self._socket.recvfrom(READ_BYTES)
            except BlockingIOError:
                break
            except OSError:  # a client's port is closed; it may open again
                continue
            self._log.heard(place_text(sender), self._url)
            self._client(sender, simulator, now_s).link.receive(data)
        self._forget_silent(simulator, now_s)
        for address, client in self._clients.items():
            queued = client.link.take()  # packets from before a restart are still sent: the acknowledgement
            if client.link.dropped:
                client.link = simulator.connect(self._serial_port, f"udp:{place_text(address)}")
            for piece in datagrams(queued):
                with contextlib.suppress(OSError):
                    self._socket.sendto(piece, address)

    def _client(self, sender: Address, simulator: Simulator, now_s: float) -> UdpClient:
        if not self._listens:
            # The answer may come from another address; from now on that one is used.
            (address,) = self._clients
            self._clients = {sender: self._clients[address]}
        elif sender not in self._clients:
            if len(self._clients) >= MOST_CLIENTS:
                self._forget(min(self._clients, key=lambda address: self._clients[address].heard_s), simulator)
            link = simulator.connect(self._serial_port, f"udp:{place_text(sender)}")
            self._clients[sender] = UdpClient(link, now_s)
        self._clients[sender].heard_s = now_s
        return self._clients[sender]

    def _forget_silent(self, simulator: Simulator, now_s: float) -> None:
        for address in list(self._clients):
            if len(self._clients) > 1 and now_s - self._clients[address].heard_s > SILENT_S:
                self._forget(address, simulator)

    def _forget(self, address: Address, simulator: Simulator) -> None:
        simulator.disconnect(self._clients.pop(address).link)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
