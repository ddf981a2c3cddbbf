"""Counts MAVLink packets in a stream of bytes, by their lengths alone."""

from __future__ import annotations

from dataclasses import dataclass

MAGIC_1, MAGIC_2, SIGNED = 0xFE, 0xFD, 1
HEAD_BYTES = 3
"""Magic, payload's length, and MAVLink 2's flags: enough to know how long a packet is."""


def packet_bytes(data: bytes | bytearray, at: int) -> int:
    """Length of the packet that begins here, from its first three bytes."""
    if data[at] == MAGIC_1:
        return data[at + 1] + 8
    return data[at + 1] + 12 + (13 if data[at + 2] & SIGNED else 0)


@dataclass
class PacketCounter:
    """How many packets have begun so far. Bytes between packets are passed over; pieces may be cut anywhere."""

    packets: int = 0
    _skip: int = 0
    _rest: bytes = b""

    def feed(self, data: bytes) -> None:
        """The next bytes of the stream."""
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
