"""RPLIDAR A1 and C1: the standard scan, five bytes a point without a check sum (SLAMTEC's interface protocol).

A point: quality (six bits), inverted start flag, start flag; angle in 1/64 degree above a bit that is always set;
distance in 1/4 mm. Angle and distance are little endian, two bytes each.

One point in eight of garbage looks valid. So points count only in rows: each must look valid, and its angle must go on
from the one before. Rows must be long, because points that are read one byte aside look much alike, too. A row ends
where a point does not fit, and its last three points are not used: if a byte was lost in one of them, its distance is
wrong, and only the next ones show it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.lidar.points import NO_POINTS, Points, joined

POINT_BYTES = 5
ROW = 12
"""This many points in a row are needed before one is believed."""
HELD = 3
"""The last of a row, which are not used; while it goes on, they wait."""
LEAST_STEP_DEG, MOST_STEP_DEG = -2.0, 6.0
"""From one point to the next: 2000 to 5000 points a second and 5 to 12 turns are 0.4 to 2.2 degrees apart."""

Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]


class RplidarDecoder:
    """Decodes the stream that follows a scan command; the descriptor before it is skipped like any other garbage."""

    def __init__(self) -> None:
        self.bad_bytes = 0
        self.clock_ms: int | None = None
        self._rest = b""
        self._in_row = False
        """Whether the rest begins with points that were found to be in a row."""

    def feed(self, data: bytes) -> Points:
        """The points completed by these bytes; the last ones always wait for those behind them."""
        buffer = np.frombuffer(self._rest + data, np.uint8)
        found: list[Points] = []
        at = 0
        while True:
            if not self._in_row:
                begin = _row_begins(buffer[at:])
                self._in_row = begin is not None
                skipped = max(len(buffer) - at - (POINT_BYTES * ROW - 1), 0) if begin is None else begin
                self.bad_bytes += skipped
                at += skipped
                if begin is None:
                    break
            points, ended = _row(buffer[at:])
            found.append(points)
            at += POINT_BYTES * len(points)
            if not ended:
                break
            self._in_row = False
            at += POINT_BYTES * HELD
            self.bad_bytes += POINT_BYTES * HELD
        self._rest = buffer[at:].tobytes()
        return joined(found)


def _row_begins(buffer: Bytes) -> int | None:
    """Where the first row begins; None if none does in these bytes."""
    starts = len(buffer) - POINT_BYTES * ROW + 1
    if starts <= 0:
        return None
    places = len(buffer) - POINT_BYTES + 1
    valid = _valid(buffer[:places], buffer[1 : places + 1])
    angle = buffer[1 : places + 1].astype(np.int32) + 256 * buffer[2 : places + 2].astype(np.int32) >> 1
    valid &= angle < 360 * 64
    good = valid[:starts].copy()
    for number in range(1, ROW):
        here, before = number * POINT_BYTES, (number - 1) * POINT_BYTES
        good &= valid[here : here + starts]
        good &= _goes_on(angle[before : before + starts] / 64.0, angle[here : here + starts] / 64.0)
    found = np.flatnonzero(good)
    return int(found[0]) if len(found) else None


def _row(buffer: Bytes) -> tuple[Points, bool]:
    """The points in a row from the start of these bytes on, without the last three; and whether the row has ended."""
    count = len(buffer) // POINT_BYTES
    if count < HELD:
        return NO_POINTS, False
    table = buffer[: count * POINT_BYTES].reshape(count, POINT_BYTES)
    words = table.astype(np.int32)
    angle_deg = (words[:, 1] + 256 * words[:, 2] >> 1) / 64.0
    good = _valid(table[:, 0], table[:, 1]) & (angle_deg < 360.0)
    good[1:] &= _goes_on(angle_deg[:-1], angle_deg[1:])
    bad = np.flatnonzero(~good)
    ended = bool(len(bad))
    last = max((int(bad[0]) if ended else count) - HELD, 0)
    range_m = (words[:last, 3] + 256 * words[:last, 4]) / 4000.0
    return Points(angle_deg[:last], range_m, (words[:last, 0] >> 2).astype(np.float64)), ended


def _valid(first: Bytes, second: Bytes) -> Flags:
    """Whether the flags of points are possible."""
    return np.asarray(((first ^ first >> 1) & second & 1).astype(np.bool_))


def _goes_on(before_deg: NDArray[np.float64], angle_deg: NDArray[np.float64]) -> Flags:
    step_deg = (angle_deg - before_deg + 180.0) % 360.0 - 180.0
    return np.asarray((step_deg >= LEAST_STEP_DEG) & (step_deg <= MOST_STEP_DEG))
