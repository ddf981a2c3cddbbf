"""MAVLink over UDP; every datagram holds whole packets."""

from __future__ import annotations

import errno
import socket
from typing import Any

from companion.mavlink.byte_link import MAX_READ_BYTES, LinkError
from companion.mavlink.port_users import in_words, of_port

Address = tuple[Any, ...]
MAX_PEERS = 8
"""With more peers than this on one port, the one silent for longest is dropped."""


def resolve(host: str, port: int, kind: socket.SocketKind, what: str) -> tuple[socket.AddressFamily, Address]:
    """Family and address of a host name or number. Raises LinkError.

    May block for the name server, so it is called only when a link is opened.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    except (OSError, UnicodeError) as error:
        raise LinkError(f"{what}: host '{host}' is not known; check the name or use its number ({error})") from error
    return family, address


def cannot_listen(what: str, error: OSError, kind: str, port: int) -> LinkError:
    """The error for an address that is in use or is not this computer's; ``kind``: tcp or udp."""
    remedy = "stop the other program or choose another port"
    if error.errno == errno.EADDRNOTAVAIL:
        remedy = "this computer has no such address, 0.0.0.0 listens on all it has"
    elif error.errno == errno.EADDRINUSE and (users := of_port(kind, port)):
        remedy = f"{in_words(users)} has it; stop that one or choose another port (docs/ports.md)"
    return LinkError(f"{what}: cannot listen: {error.strerror}; {remedy}")


class UdpLink:
    """A datagram socket. ``bind``: listens, and sends to all peers it has heard; otherwise sends to the address.

    Raises LinkError when the port is taken or the address unknown.
    """

    def __init__(self, host: str, port: int, *, bind: bool) -> None:
        self._name = f"{'udpin' if bind else 'udpout'}:{host}:{port}"
        family, address = resolve(host, port, socket.SOCK_DGRAM, self._name)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peers: dict[Address, None] = {}
        self._fixed = None if bind else address
        self.dropped = 0
        if bind:
            try:
                self._socket.bind(address)
            except OSError as error:
                self._socket.close()
                raise cannot_listen(self._name, error, "udp", port) from error

    @property
    def description(self) -> str:
        """The link in words."""
        if self._fixed is None and not self._peers:
            return f"{self._name} (nobody has spoken yet)"
        return self._name

    @property
    def connected(self) -> bool:
        """Always True: datagrams have no connection."""
        return True

    @property
    def port(self) -> int:
        """The local port, which matters if 0 was given."""
        return int(self._socket.getsockname()[1])

    def read(self) -> bytes:
        """All datagrams that have arrived, joined."""
        datagrams: list[bytes] = []
        size = 0
        while size < MAX_READ_BYTES:
            try:
                data, sender = self._socket.recvfrom(MAX_READ_BYTES)
            except BlockingIOError:
                break
            except OSError:
                # For instance "connection refused" from a host that does not listen yet.
                break
            if self._fixed is None:
                self._remember(sender)
            datagrams.append(data)
            size += len(data) + 1
        return b"".join(datagrams)

    def write(self, data: bytes) -> None:
        """Send one datagram to all peers heard (bound) or to the address."""
        for address in [self._fixed] if self._fixed is not None else list(self._peers):
            try:
                self._socket.sendto(data, address)
            except OSError:
                self.dropped += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _remember(self, sender: Address) -> None:
        self._peers.pop(sender, None)
        self._peers[sender] = None
        if len(self._peers) > MAX_PEERS:
            del self._peers[next(iter(self._peers))]
