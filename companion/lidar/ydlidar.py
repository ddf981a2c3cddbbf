"""YDLIDAR X4: packets of up to 40 points with a check sum (YDLIDAR X4 development manual).

A packet: 0x55AA, type, number of points, angles of the first and the last point, check sum, then the points. Numbers
are little endian, two bytes each but for type and number. Angles: bit 0 is always set, the others count 1/64 degree;
distances count 1/4 mm. The check sum is the exclusive or of all words but itself. The laser sits beside the receiver,
so the direction of a point differs from the angle that the packet tells, by -8 degrees far away. Without an echo
nothing is there along all of the laser's ray, which leads that way, too.
"""

from __future__ import annotations

import numpy as np

from companion.lidar.points import Floats, Points, joined, next_header

HEADER = b"\xaa\x55"
HEAD_BYTES, MOST_POINTS = 10, 40
BASE_MM, FOCUS_MM = 155.3, 21.8
"""Of the manual's formula for the direction of points: beside the receiver, and where the ray crosses its axis."""
MOST_STEP_DEG = 3.0
"""Between two points of a packet; ten turns a second and 5000 points are 0.7 degrees apart."""


class YdlidarDecoder:
    """Decodes the stream that follows a scan command. The strength of an echo is not told."""

    def __init__(self) -> None:
        self.bad_bytes = 0
        self.clock_ms: int | None = None
        self._rest = b""

    def feed(self, data: bytes) -> Points:
        """The points completed by these bytes."""
        buffer, at = self._rest + data, 0
        found: list[Points] = []
        while True:
            begin = next_header(buffer, HEADER, at)
            self.bad_bytes += begin - at
            at = begin
            if at + HEAD_BYTES > len(buffer):
                break
            size = _size(buffer, at)
            if size and at + size > len(buffer):
                break
            points = _points(buffer[at : at + size]) if size else None
            if points is None:
                self.bad_bytes += 1
                at += 1
            else:
                found.append(points)
                at += size
        self._rest = buffer[at:]
        return joined(found)


def _size(buffer: bytes, at: int) -> int:
    """Bytes of the packet whose head begins here; 0 if it is none."""
    count = buffer[at + 3]
    if not 0 < count <= MOST_POINTS or not buffer[at + 4] & buffer[at + 6] & 1:
        return 0
    return HEAD_BYTES + 2 * count


def _points(packet: bytes) -> Points | None:
    """The points of a packet; None if its check sum is wrong or its angles are impossible."""
    words = np.frombuffer(packet, "<u2")
    if np.bitwise_xor.reduce(words):  # the check sum stands among them
        return None
    range_mm = words[5:] / 4.0
    first_deg, last_deg = (words[2] >> 1) / 64.0, (words[3] >> 1) / 64.0
    steps = max(len(range_mm) - 1, 1)
    step_deg = ((last_deg - first_deg) % 360.0) / steps
    if first_deg > 360.0 or last_deg > 360.0 or step_deg > MOST_STEP_DEG:
        return None
    angle_deg = first_deg + step_deg * np.arange(len(range_mm)) + _aside_deg(range_mm)
    return Points(angle_deg % 360.0, range_mm / 1000.0, np.zeros(len(range_mm)))


def _aside_deg(range_mm: Floats) -> Floats:
    """How much the direction of each point differs from the angle of its packet; without an echo: of the ray's end."""
    seen_mm = np.where(range_mm > 0.0, range_mm, np.inf)
    return np.degrees(np.arctan(FOCUS_MM * (1.0 / seen_mm - 1.0 / BASE_MM)))
