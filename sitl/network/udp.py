"""UDP: one partner that is sent to (udpout), or everybody who speaks to a port (udpin)."""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass

from sitl.network.endpoint import READ_BYTES, datagrams, place_text
from sitl.network.event_log import EventLog
from sitl.sim_link import SimLink
from sitl.simulator import Simulator

Address = tuple[str, int]
MOST_PARTNERS = 8
SILENT_S = 30.0
"""A partner that has said nothing for so long is forgotten when there are others."""
MOST_DATAGRAMS = 1000
"""Taken in at once; what comes faster waits, so that a flood does not stop the vehicle."""


@dataclass
class Partner:
    """Somebody who spoke to the port, and the link made for him."""

    link: SimLink
    heard_s: float


class UdpEndpoint:
    """Every partner has a link of its own; with ``listens`` they come by themselves, else there is just the one."""

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
        self._partners: dict[Address, Partner] = {}
        try:
            if listens:
                self._socket.bind((host, port))
            else:
                address = (socket.gethostbyname(host), port)
                self._socket.bind(("", 0))
                self._partners[address] = Partner(simulator.connect(serial_port, f"udp:{place_text(address)}"), 0.0)
        except OSError:
            self._socket.close()
            raise

    def descriptors(self) -> list[int]:
        """The one socket."""
        return [self._socket.fileno()]

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Datagrams in and out; an absent partner is no error."""
        for _ in range(MOST_DATAGRAMS):
            try:
                data, sender = self._socket.recvfrom(READ_BYTES)
            except BlockingIOError:
                break
            except OSError:  # a partner's port is closed; it may open again
                continue
            self._log.heard(place_text(sender), self._url)
            self._partner(sender, simulator, now_s).link.receive(data)
        self._forget_silent(simulator, now_s)
        for address, partner in self._partners.items():
            queued = partner.link.take()  # what was said before a restart is still sent: the answer to who asked for it
            if partner.link.dropped:
                partner.link = simulator.connect(self._serial_port, f"udp:{place_text(address)}")
            for piece in datagrams(queued):
                with contextlib.suppress(OSError):
                    self._socket.sendto(piece, address)

    def _partner(self, sender: Address, simulator: Simulator, now_s: float) -> Partner:
        if not self._listens:
            # The answer may come from another address than the one sent to; from now on it is sent there.
            (address,) = self._partners
            self._partners = {sender: self._partners[address]}
        elif sender not in self._partners:
            if len(self._partners) >= MOST_PARTNERS:
                self._forget(min(self._partners, key=lambda address: self._partners[address].heard_s), simulator)
            link = simulator.connect(self._serial_port, f"udp:{place_text(sender)}")
            self._partners[sender] = Partner(link, now_s)
        self._partners[sender].heard_s = now_s
        return self._partners[sender]

    def _forget_silent(self, simulator: Simulator, now_s: float) -> None:
        for address in list(self._partners):
            if len(self._partners) > 1 and now_s - self._partners[address].heard_s > SILENT_S:
                self._forget(address, simulator)

    def _forget(self, address: Address, simulator: Simulator) -> None:
        simulator.disconnect(self._partners.pop(address).link)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
