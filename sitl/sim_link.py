"""A link to the simulated vehicle: bytes in and out, packet counters, link faults.

Nouns: SimLink.
"""

from __future__ import annotations

from dataclasses import dataclass

from sitl.autopilot.channel import Channel
from sitl.faults.link_faults import LinkQueue
from sitl.faults.player import FaultPlayer

MAGIC_1, MAGIC_2, SIGNED = 0xFE, 0xFD, 1
HEAD_BYTES = 3
"""Magic, length of the payload, and flags of MAVLink 2: enough to know the length of a packet."""


def packet_bytes(data: bytes | bytearray, at: int) -> int:
    """Length of the packet that begins here, from its first three bytes."""
    if data[at] == MAGIC_1:
        return data[at + 1] + 8
    return data[at + 1] + 12 + (13 if data[at + 2] & SIGNED else 0)


@dataclass
class PacketCounter:
    """Counts packets in a stream that is given in pieces; bytes between packets are skipped."""

    packets: int = 0
    _skip: int = 0
    _rest: bytes = b""

    def feed(self, data: bytes) -> None:
        """Take in the next bytes of the stream."""
        if self._rest:
            data, self._rest = self._rest + data, b""
        at, end = self._skip, len(data)
        while at < end:
            if data[at] not in (MAGIC_1, MAGIC_2):
                at += 1
            elif at + HEAD_BYTES > end:
                self._rest = data[at:]
                break
            else:
                self.packets += 1
                at += packet_bytes(data, at)
        self._skip = max(at - end, 0)


class SimLink:
    """A link to the vehicle and to the components on its network."""

    def __init__(self, channel: Channel, number: int, name: str = "") -> None:
        """Created by ``Simulator.connect``."""
        self.channel = channel
        self.number = number
        self.name = name
        self.inbox = bytearray()
        self.dropped = False
        self.queues: tuple[LinkQueue, LinkQueue] | None = None
        """Packets under way to and from the vehicle, on links with faults."""
        self.heard = PacketCounter()
        self.sent = PacketCounter()
        self._arrived = bytearray()

    def receive(self, data: bytes) -> None:
        """Send bytes to the vehicle, which handles them in its next main loop."""
        self.inbox += data
        self.heard.feed(data)

    def take(self) -> bytes:
        """The bytes that the vehicle has sent since the last call."""
        if self.queues is None:
            data = self.channel.take()
        else:
            data = bytes(self._arrived)
            self._arrived.clear()
        self.sent.feed(data)
        return data

    def pass_in(self, player: FaultPlayer, now_s: float) -> bytes:
        """The bytes that reach the vehicle now."""
        data = bytes(self.inbox)
        self.inbox.clear()
        if self.queues is None:
            return data
        player.pass_on(self.queues[0], data, now_s)
        return self.queues[0].arrived(now_s)

    def pass_out(self, player: FaultPlayer, now_s: float) -> None:
        """Queue what the vehicle has sent, and take in what has arrived by now."""
        if self.queues is not None:
            player.pass_on(self.queues[1], self.channel.take(), now_s)
            self._arrived += self.queues[1].arrived(now_s)
