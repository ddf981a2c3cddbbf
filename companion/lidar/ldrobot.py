"""LDROBOT LD06, LD19 and STL-19P: packets of twelve points with a CRC (development manuals of LD06 and LD19).

A packet: 0x54, 0x2C, speed (degrees a second), start angle (0.01 degree), twelve times distance (mm) and intensity
(one byte), end angle, time (ms), CRC-8 with polynomial 0x4D of all before. Numbers are little endian, two bytes each.
"""

from __future__ import annotations

import numpy as np

from companion.lidar.points import Points, joined

HEADER = b"\x54\x2c"
PACKET_BYTES, POINTS = 47, 12
POLYNOMIAL = 0x4D
MOST_SPAN_DEG = 30.0
"""A packet that covers more than this is none: eight bits of check sum let one damaged packet in 256 pass."""
SAMPLE = np.dtype([("range_mm", "<u2"), ("intensity", "u1")])


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
        self._rest = b""

    def feed(self, data: bytes) -> Points:
        """The points completed by these bytes."""
        buffer, at = self._rest + data, 0
        found: list[Points] = []
        while True:
            begin = buffer.find(HEADER, at)
            if begin < 0:
                begin = len(buffer) - (buffer[-1:] == HEADER[:1])
            self.bad_bytes += max(begin - at, 0)
            at = max(begin, at)
            if at + PACKET_BYTES > len(buffer):
                break
            packet = buffer[at : at + PACKET_BYTES]
            points = _points(packet) if crc8(packet[:-1]) == packet[-1] else None
            if points is None:
                self.bad_bytes += 1
                at += 1
            else:
                found.append(points)
                at += PACKET_BYTES
        self._rest = buffer[at:]
        return joined(found)


def _points(packet: bytes) -> Points | None:
    """The points of a packet whose check sum is right; None if its angles are impossible."""
    start_deg = int.from_bytes(packet[4:6], "little") / 100.0
    span_deg = (int.from_bytes(packet[42:44], "little") / 100.0 - start_deg) % 360.0
    if start_deg >= 360.0 or span_deg > MOST_SPAN_DEG:
        return None
    samples = np.frombuffer(packet, SAMPLE, POINTS, 6)
    angle_deg = np.linspace(start_deg, start_deg + span_deg, POINTS, dtype=np.float64) % 360.0
    return Points(np.asarray(angle_deg), samples["range_mm"] / 1000.0, samples["intensity"].astype(np.float64))
