"""Splits a stream of bytes into MAVLink packets, by the rules of the firmware's own parser.

A damaged header consumes as many bytes as it claims, and each byte is inspected once, so the cost of a flood is
proportional to its size. Only the length in the header is used here; checksums are verified elsewhere.
"""

from __future__ import annotations

import re

MAGIC_1, MAGIC_2 = 0xFE, 0xFD

SIGNED = 0x01

HEADER_1, HEADER_2, CHECKSUM, SIGNATURE = 6, 10, 2, 13

BEGINNING = re.compile(b"[\xfd\xfe]")
"""A byte with which a packet may begin."""


def packet_size(data: bytes | bytearray, at: int) -> int | None:
    """Length in bytes of the packet that begins at ``at``, from its header; None while the header is incomplete."""
    if data[at] == MAGIC_1:
        return HEADER_1 + data[at + 1] + CHECKSUM if at + 1 < len(data) else None
    if at + 2 >= len(data):
        return None
    return HEADER_2 + data[at + 1] + CHECKSUM + (SIGNATURE if data[at + 2] & SIGNED else 0)


class Framer:
    """Takes bytes in pieces of any size and returns complete packets, whose checksums are not verified yet."""

    def __init__(self) -> None:
        """Nothing received yet."""
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The packets completed by these bytes; bytes between packets are dropped."""
        buffer = self._rest + data
        packets: list[bytes] = []
        at = 0
        while (found := BEGINNING.search(buffer, at)) is not None:
            at = found.start()
            size = packet_size(buffer, at)
            if size is None:
                break
            if buffer[at] == MAGIC_2 and buffer[at + 2] & ~SIGNED:
                at += 3  # an unknown flag makes the packet unreadable
                continue
            if at + size > len(buffer):
                break
            packets.append(buffer[at : at + size])
            at += size
        self._rest = buffer[at:] if found is not None else b""
        return packets
