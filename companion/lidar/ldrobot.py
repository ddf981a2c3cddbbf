"""LDROBOT LD06, LD19 and STL-19P: packets of twelve points with a CRC (development manuals of LD06 and LD19).

A packet: 0x54, 0x2C, speed (degrees a second), start angle (0.01 degree), twelve times distance (mm) and intensity
(one byte), end angle, time (ms), CRC-8 with polynomial 0x4D of all before. Numbers are little endian, two bytes each.
"""

from __future__ import annotations

import numpy as np

from companion.lidar.points import NO_POINTS, Points, next_header

HEADER = b"\x54\x2c"
PACKET_BYTES, POINTS = 47, 12
POLYNOMIAL = 0x4D
TURN, MOST_SPAN = 36000, 3000
"""In 1/100 degree. A packet that covers more than the second is none: eight bits of check sum let one damaged packet in
256 pass."""
SAMPLE = np.dtype([("range_mm", "<u2"), ("intensity", "u1")])
PACKET = np.dtype(
    [("head", "<u2", 2), ("start", "<u2"), ("samples", SAMPLE, POINTS), ("end", "<u2"), ("time", "<u2"), ("crc", "u1")]
)


def _table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1 ^ POLYNOMIAL if value & 0x80 else value << 1) & 0xFF  # noqa: PLW2901
        table.append(value)
    return bytes(table)


CRC_TABLE = _table()


def crc8(data: bytes) -> int:
    """The check sum of these bytes."""
    crc = 0
    for byte in data:
        crc = CRC_TABLE[crc ^ byte]
    return crc


class LdrobotDecoder:
    """Decodes the stream, which begins by itself when the sensor has power."""

    def __init__(self) -> None:
        self.bad_bytes = 0
        self.clock_ms: int | None = None
        self._rest = b""

    def feed(self, data: bytes) -> Points:
        """The points completed by these bytes."""
        buffer, at = self._rest + data, 0
        found: list[bytes] = []
        while True:
            begin = next_header(buffer, HEADER, at)
            self.bad_bytes += begin - at
            at = begin
            if at + PACKET_BYTES > len(buffer):
                break
            packet = buffer[at : at + PACKET_BYTES]
            if _is_valid(packet):
                found.append(packet)
                at += PACKET_BYTES
            else:
                self.bad_bytes += 1
                at += 1
        self._rest = buffer[at:]
        if not found:
            return NO_POINTS
        self.clock_ms = int.from_bytes(found[-1][44:46], "little")
        return _points(b"".join(found))


def _is_valid(packet: bytes) -> bool:
    """Whether the check sum is right and the angles are possible."""
    if crc8(packet[:-1]) != packet[-1]:
        return False
    start, end = (int.from_bytes(packet[at : at + 2], "little") for at in (4, 42))
    return start < TURN and (end - start) % TURN <= MOST_SPAN


def _points(packets: bytes) -> Points:
    """The points of packets that are valid."""
    table = np.frombuffer(packets, PACKET)
    start = table["start"].astype(np.float64)
    span = (table["end"] - start) % TURN
    angle_deg = (start[:, None] + span[:, None] * np.arange(POINTS) / (POINTS - 1)) / 100.0 % 360.0
    samples = table["samples"].ravel()
    return Points(angle_deg.ravel(), samples["range_mm"] / 1000.0, samples["intensity"].astype(np.float64))
