"""What all endpoints have in common: the protocol, addresses, datagrams of complete packets.

Nouns: Endpoint.
"""

from __future__ import annotations

from typing import Protocol

from sitl.autopilot.framing import packet_size
from sitl.simulator import Simulator

READ_BYTES = 65536
DATAGRAM_BYTES = 1400
BACKLOG_BYTES = 1_000_000
"""A TCP client is dropped when this much waits for it."""

LINK_REMEDY = "name a link that does not exist yet, in a folder that does; delete one that a killed simulator left"
"""What to do where the link to a pseudo-terminal cannot be made."""


class ListenError(Exception):
    """An address that cannot be used; the text is one line."""


class Endpoint(Protocol):
    """An open address where clients exchange bytes with the simulator."""

    def descriptors(self) -> list[int]:
        """File descriptors to wait on for input."""
        ...

    def exchange(self, simulator: Simulator, now_s: float) -> None:
        """Receive and send without blocking. ``now_s``: real seconds."""
        ...

    def close(self) -> None:
        """Close everything that is open."""
        ...


def place_text(place: tuple[str, int]) -> str:
    """An address as HOST:PORT."""
    return f"{place[0]}:{place[1]}"


def network_address(url: str, forms: str) -> tuple[str, int]:
    """Host and port of ``tcp:``, ``udpout:`` or ``udpin:``. Raises ListenError that lists the valid ``forms``."""
    kind, _, place = url.partition(":")
    host, _, port = place.rpartition(":")
    known = kind in ("tcp", "udpout", "udpin")
    if not known or not host or not (port.isascii() and port.isdigit()):
        raise ListenError(f"{url}: not an address; write {forms}")
    if len(port) > 9 or not 0 < int(port) < 65536:
        raise ListenError(f"{url}: {port:.20} is not a port; choose one from 1 to 65535")
    return host, int(port)


def packets(data: bytes) -> list[bytes]:
    """The single packets in the bytes of a link."""
    pieces, at = [], 0
    while at < len(data):
        size = packet_size(data, at) or len(data) - at
        pieces.append(data[at : at + size])
        at += size
    return pieces


def datagrams(data: bytes) -> list[bytes]:
    """The bytes in pieces of complete packets, as many as fit into one datagram."""
    pieces: list[bytes] = []
    for packet in packets(data):
        if pieces and len(pieces[-1]) + len(packet) <= DATAGRAM_BYTES:
            pieces[-1] += packet
        else:
            pieces.append(packet)
    return pieces
