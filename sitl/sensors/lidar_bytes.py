"""The bytes that lidars send on their serial lines, as the vendors' manuals describe them; and the commands they obey.

Written from the manuals and not from the companion's decoders, so that an error of one side does not cancel itself out.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np

from sitl.world.world import Floats


@dataclass(frozen=True, slots=True)
class LidarMake:
    """A model: how fast it turns and measures, how far it sees, and how strong its strongest echo is (0: untold)."""

    name: str
    points_hz: float
    turns_hz: float
    max_m: float
    most_quality: int


MAKES = {
    make.name: make
    for make in (
        LidarMake("LD06", 4500.0, 10.0, 12.0, 255),
        LidarMake("LD19", 4500.0, 10.0, 12.0, 255),
        LidarMake("RPLIDAR-A1", 2000.0, 5.5, 12.0, 63),
        LidarMake("RPLIDAR-C1", 5000.0, 10.0, 12.0, 63),
        LidarMake("YDLIDAR-X4", 5000.0, 7.0, 10.0, 0),
    )
}


class Encoder(Protocol):
    """Makes bytes of points: angles in degrees, ranges in metres (0: no echo), quality."""

    talks: bool
    """Whether it sends points."""

    def encode(self, angle_deg: Floats, range_m: Floats, quality: Floats, time_s: float) -> bytes:
        """The packets completed by these points."""
        ...

    def hear(self, data: bytes) -> bytes:
        """Obey commands; returns the answer."""
        ...

    def aside_deg(self, range_m: Floats) -> Floats:
        """How far beside the told angle a point of this range lies; 0 m: none was met."""
        ...


def encoder_of(make: LidarMake) -> Encoder:
    """A lidar that has just got power."""
    if make.name.startswith("RPLIDAR"):
        return RplidarEncoder()
    return YdlidarEncoder() if make.name.startswith("YDLIDAR") else LdrobotEncoder(make.turns_hz)


LDROBOT_SAMPLE = np.dtype([("range_mm", "<u2"), ("quality", "u1")])


class LdrobotEncoder:
    """LD06, LD19: 47 bytes for twelve points; no commands."""

    COUNT = 12

    def __init__(self, turns_hz: float) -> None:
        self.talks = True
        self._speed_deg_s = round(360.0 * turns_hz)
        self._angles_deg: list[float] = []
        self._samples = b""

    def encode(self, angle_deg: Floats, range_m: Floats, quality: Floats, time_s: float) -> bytes:
        """The packets completed by these points."""
        samples = np.empty(len(angle_deg), LDROBOT_SAMPLE)
        samples["range_mm"] = np.minimum(np.rint(1000.0 * range_m), 65535.0)
        samples["quality"] = np.rint(quality)
        self._angles_deg += angle_deg.tolist()
        self._samples += samples.tobytes()
        data = b""
        while len(self._angles_deg) >= self.COUNT:
            data += self._packet(time_s)
        return data

    def _packet(self, time_s: float) -> bytes:
        """The first points that wait."""
        first, last = (round(100.0 * self._angles_deg[one]) % 36000 for one in (0, self.COUNT - 1))
        size = self.COUNT * LDROBOT_SAMPLE.itemsize
        samples, self._samples = self._samples[:size], self._samples[size:]
        del self._angles_deg[: self.COUNT]
        tail = struct.pack("<HH", last, round(1000.0 * time_s) % 30000)
        packet = struct.pack("<BBHH", 0x54, 0x2C, self._speed_deg_s, first) + samples + tail
        return packet + bytes([crc8(packet)])

    def hear(self, data: bytes) -> bytes:
        """It listens to nobody."""
        return b""

    def aside_deg(self, range_m: Floats) -> Floats:
        """Laser and receiver share their axis."""
        return np.zeros_like(range_m)


def crc8(data: bytes) -> int:
    """CRC-8, polynomial x^8 + x^6 + x^3 + x^2 + 1."""
    crc, of_byte = 0, crc8_of_bytes()
    for byte in data:
        crc = of_byte[crc ^ byte]
    return crc


@cache
def crc8_of_bytes() -> bytes:
    """The CRC-8 of each single byte, bit by bit."""
    table = bytearray(range(256))
    for byte in range(256):
        for _ in range(8):
            table[byte] = (table[byte] << 1) & 0xFF ^ (0x4D if table[byte] & 0x80 else 0)
    return bytes(table)


class RplidarEncoder:
    """RPLIDAR: five bytes a point, between the commands scan and stop."""

    def __init__(self) -> None:
        self.talks = False
        self._before_deg = 0.0

    def encode(self, angle_deg: Floats, range_m: Floats, quality: Floats, time_s: float) -> bytes:
        """All of these points."""
        data = bytearray()
        for angle, range_, strength in zip(angle_deg.tolist(), range_m.tolist(), quality.tolist(), strict=True):
            starts, self._before_deg = angle < self._before_deg, angle
            angle_q6 = round(64.0 * angle) % (360 * 64)
            first = round(strength) << 2 | (0b01 if starts else 0b10)
            data += struct.pack("<BHH", first, angle_q6 << 1 | 1, min(round(4000.0 * range_), 65535))
        return bytes(data)

    def hear(self, data: bytes) -> bytes:
        """Scan, and stop."""
        answer = b""
        for at in range(len(data) - 1):
            command = data[at : at + 2]
            if command == b"\xa5\x25":
                self.talks = False
            elif command in (b"\xa5\x20", b"\xa5\x21"):
                self.talks = True
                answer += b"\xa5\x5a\x05\x00\x00\x40\x81"
        return answer

    def aside_deg(self, range_m: Floats) -> Floats:
        """Its angles are corrected already."""
        return np.zeros_like(range_m)


class YdlidarEncoder:
    """YDLIDAR X4: up to 40 points a packet, and one packet with a single point at the start of each turn."""

    COUNT = 40

    def __init__(self) -> None:
        self.talks = False
        self._points: list[tuple[int, int]] = []
        """Angle in 1/64 degree and range in 1/4 mm."""

    def encode(self, angle_deg: Floats, range_m: Floats, quality: Floats, time_s: float) -> bytes:
        """The packets completed by these points."""
        data = b""
        for angle, range_ in zip(angle_deg.tolist(), range_m.tolist(), strict=True):
            point = round(64.0 * angle) % (360 * 64), min(round(4000.0 * range_), 65535)
            if self._points and point[0] < self._points[-1][0]:  # a new turn
                data += self._packet(0) + ydlidar_packet(1, [point])
                continue
            self._points.append(point)
            if len(self._points) == self.COUNT:
                data += self._packet(0)
        return data

    def _packet(self, kind: int) -> bytes:
        points, self._points = self._points, []
        return ydlidar_packet(kind, points)

    def hear(self, data: bytes) -> bytes:
        """Scan, and stop."""
        answer = b""
        for at in range(len(data) - 1):
            command = data[at : at + 2]
            if command == b"\xa5\x65":
                self.talks = False
                self._points.clear()
            elif command == b"\xa5\x60":
                self.talks = True
                answer += b"\xa5\x5a\x05\x00\x00\x40\x81"
        return answer

    def aside_deg(self, range_m: Floats) -> Floats:
        """The manual's formula: the laser's ray begins 21.8 mm beside the receiver and crosses its axis 155.3 mm ahead.

        Where it meets nothing it ends far away, where the formula tends to -8 degrees.
        """
        range_mm = np.where(range_m > 0.0, 1000.0 * range_m, 1e9)
        tangent: Floats = 21.8 * (155.3 - range_mm) / (155.3 * range_mm)
        return np.degrees(np.arctan(tangent))


def ydlidar_packet(kind: int, points: list[tuple[int, int]]) -> bytes:
    """A packet of the YDLIDAR X4."""
    head = 0x55AA, kind | len(points) << 8, points[0][0] << 1 | 1, points[-1][0] << 1 | 1
    check = 0
    for word in (*head, *(range_ for _, range_ in points)):
        check ^= word
    return struct.pack(f"<5H{len(points)}H", *head, check, *(range_ for _, range_ in points))
