"""From a stream of bytes to whole MAVLink packets, by the rules of the firmware's own parser.

A beginning that is damaged takes as many bytes with it as its header claims, and every byte is looked at once, so a flood of
anything costs time in proportion to its size. Nothing of the contents is believed here but the length.
"""

from __future__ import annotations

import re

MAGIC_1, MAGIC_2 = 0xFE, 0xFD

SIGNED = 0x01

HEADER_1, HEADER_2, CHECKSUM, SIGNATURE = 6, 10, 2, 13

BEGINNING = re.compile(b"[\xfd\xfe]")
"""A byte that a packet may begin with."""


def packet_size(data: bytes | bytearray, at: int) -> int | None:
    """Bytes of the packet that begins at ``at``, as its header says; None while the header is not there yet."""
    if data[at] == MAGIC_1:
        return HEADER_1 + data[at + 1] + CHECKSUM if at + 1 < len(data) else None
    if at + 2 >= len(data):
        return None
    return HEADER_2 + data[at + 1] + CHECKSUM + (SIGNATURE if data[at + 2] & SIGNED else 0)


class Framer:
    """Takes bytes in any pieces, gives what looks like whole packets; their checksums are not checked yet."""

    def __init__(self) -> None:
        """Nothing received yet."""
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The packets completed by these bytes; noise between them is dropped."""
        buffer = self._rest + data
        packets: list[bytes] = []
        at = 0
        while (found := BEGINNING.search(buffer, at)) is not None:
            at = found.start()
            size = packet_size(buffer, at)
            if size is None:
                break
            if buffer[at] == MAGIC_2 and buffer[at + 2] & ~SIGNED:
                at += 3  # a flag that nobody knows makes the packet unreadable
                continue
            if at + size > len(buffer):
                break
            packets.append(buffer[at : at + size])
            at += size
        self._rest = buffer[at:] if found is not None else b""
        return packets
