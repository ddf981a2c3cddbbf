"""Splits a stream of bytes into MAVLink packets with valid checksums (MAVLink guide, "Packet Serialization").

pymavlink's stream parser skips as many bytes as a damaged header claims, up to 280 good ones, and decodes every
message. Here a start byte whose packet fails its check costs one byte, a stray start byte does not delay the valid
packets after it, and messages are not decoded.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
HEADER_V1, HEADER_V2 = 6, 10
CHECKSUM, SIGNATURE = 2, 13
SIGNED = 0x01
AUTOPILOT = 1
"""Component id of the autopilot: only it speaks for the vehicle."""
MAGIC = re.compile(b"[\xfd\xfe]")


class Packet(NamedTuple):
    """One packet as received."""

    message_id: int
    system_id: int
    component_id: int
    sequence: int
    raw: bytes


class Framer:
    """Takes bytes in blocks of any size, gives whole packets, not decoded."""

    def __init__(self) -> None:
        self.bad_bytes = 0
        """Bytes that belong to no packet."""
        self.unknown = 0
        """Packets of messages that are not in the dialect, so that their checksum cannot be checked."""
        self._rest = b""

    def feed(self, data: bytes) -> list[Packet]:
        """The packets completed by these bytes."""
        buffer = self._rest + data
        ahead = _Ahead(buffer)
        packets: list[Packet] = []
        at = 0
        while at < len(buffer):
            if buffer[at] not in (MAGIC_V1, MAGIC_V2):
                begin = MAGIC.search(buffer, at)
                beyond = len(buffer) if begin is None else begin.start()
                self.bad_bytes += beyond - at
                at = beyond
                continue
            end = _end(buffer, at)
            if end is None:
                break
            if end > len(buffer):
                if not ahead.packet_in(at + 1, len(buffer)):
                    break  # the rest is still to come
            elif (packet := _packet(buffer, at, end)) is not None:
                packets.append(packet)
                at = end
                continue
            elif _is_unknown(buffer, at, end, ahead):
                self.unknown += 1
                at = end
                continue
            at += 1
            self.bad_bytes += 1
        self._rest = buffer[at:]
        return packets


def first_packet(buffer: bytes) -> bytes | None:
    """The valid packet at the start of these bytes; None if there is none or it is incomplete."""
    end = _end(buffer, 0) if buffer[:1] in (b"\xfe", b"\xfd") else None
    packet = _packet(buffer, 0, end) if end is not None and end <= len(buffer) else None
    return None if packet is None else packet.raw


def _packet(buffer: bytes, at: int, end: int) -> Packet | None:
    """The packet in these bytes, or None when it is unknown or damaged."""
    version_2 = buffer[at] == MAGIC_V2
    header = HEADER_V2 if version_2 else HEADER_V1
    message_id, sequence, system_id, component_id = _identity(buffer, at)
    known = ardupilotmega.mavlink_map.get(message_id)
    checked_end = at + header + buffer[at + 1]
    if known is None or (version_2 and buffer[at + 2] & ~SIGNED):
        return None
    checksum = ardupilotmega.x25crc(buffer[at + 1 : checked_end] + bytes([known.crc_extra])).crc
    if checksum != int.from_bytes(buffer[checked_end : checked_end + CHECKSUM], "little"):
        return None
    return Packet(message_id, system_id, component_id, sequence, buffer[at:end])


class _Ahead:
    """Finds the next valid packet, and remembers it, so that every byte is examined once even among garbage."""

    def __init__(self, buffer: bytes) -> None:
        self._buffer = buffer
        self._from = 0
        self._found = -1

    def packet_in(self, start: int, stop: int) -> bool:
        """Whether a valid packet begins in start <= at < stop."""
        if not self._from <= start <= self._found:
            self._from, self._found = start, self._next(start)
        return self._found < stop

    def _next(self, start: int) -> int:
        for begin in MAGIC.finditer(self._buffer, start):
            at = begin.start()
            end = _end(self._buffer, at)
            if end is not None and end <= len(self._buffer) and _packet(self._buffer, at, end) is not None:
                return at
        return len(self._buffer)


def _is_unknown(buffer: bytes, at: int, end: int, ahead: _Ahead) -> bool:
    """Whether this is a packet of an unknown message, rather than a stray start byte.

    Its checksum cannot be checked. So it must not contain a valid packet, and another packet or the end must follow it.
    """
    if _identity(buffer, at)[0] in ardupilotmega.mavlink_map:
        return False
    followed = end == len(buffer) or buffer[end] in (MAGIC_V1, MAGIC_V2)
    return followed and not ahead.packet_in(at + 1, end)


def _end(buffer: bytes, at: int) -> int | None:
    """The end of the packet that begins at ``at``; None while its header is incomplete."""
    if buffer[at] == MAGIC_V1:
        return at + HEADER_V1 + buffer[at + 1] + CHECKSUM if at + 1 < len(buffer) else None
    if at + 2 >= len(buffer):
        return None
    return at + HEADER_V2 + buffer[at + 1] + CHECKSUM + (SIGNATURE if buffer[at + 2] & SIGNED else 0)


def _identity(buffer: bytes, at: int) -> tuple[int, int, int, int]:
    """Message id, sequence number, system id and component id of a complete header."""
    if buffer[at] == MAGIC_V1:
        return buffer[at + 5], buffer[at + 2], buffer[at + 3], buffer[at + 4]
    return int.from_bytes(buffer[at + 7 : at + 10], "little"), buffer[at + 4], buffer[at + 5], buffer[at + 6]
