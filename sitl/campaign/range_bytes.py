"""Whether a packet of range data tells anything of what is straight ahead of the rover: from its bytes.

A reading that is unknown tells nothing, nor does a beam that looks down or aside (docs/safety.md).
"""

from __future__ import annotations

import math
import struct

DISTANCE_SENSOR, OBSTACLE_DISTANCE, OBSTACLE_DISTANCE_3D = 132, 330, 11037
RANGES = (DISTANCE_SENSOR, OBSTACLE_DISTANCE, OBSTACLE_DISTANCE_3D)
AHEAD_DEG = 20.0
HORIZONTAL, CUSTOM = range(8), 100
UNKNOWN = (0, 65535)
INVALID_QUALITY = 1
HEAD_BYTES = 10
TILT = math.sin(math.radians(15.0))
"""A beam that looks farther up or down does not look along the ground."""
BEAM = struct.Struct("<IHHHBBBBff4fB")
SECTORS = struct.Struct("<Q72HHHBBffB")
POINT = struct.Struct("<IfffffHBB")


def tells_ahead(kind: int, packet: bytes) -> bool:
    """``kind``: one of ``RANGES``; ``packet``: a whole one of MAVLink 2, whose zeros at the end may be left out."""
    payload = packet[HEAD_BYTES : HEAD_BYTES + packet[1]]
    if kind == OBSTACLE_DISTANCE:
        return _of_sectors(SECTORS.unpack(payload.ljust(SECTORS.size, b"\0")))
    if kind == DISTANCE_SENSOR:
        return _of_beam(*BEAM.unpack(payload.ljust(BEAM.size, b"\0"))[3:])
    _, x, y, *_ = POINT.unpack(payload.ljust(POINT.size, b"\0"))
    return x > 0.0 and _is_ahead(math.degrees(math.atan2(y, x)))


def _of_sectors(fields: tuple[float, ...]) -> bool:
    distances, (_, _, _, whole_deg, exact_deg, offset_deg, _) = fields[1:73], fields[73:]
    step_deg = exact_deg or whole_deg
    if not step_deg:
        return False
    count = min(len(distances), max(1, round(360.0 / abs(step_deg))))
    half_deg = 0.5 * abs(step_deg)
    return any(
        distances[number] not in UNKNOWN and _is_ahead(offset_deg + number * step_deg, half_deg)
        for number in range(count)
    )


def _of_beam(
    current_cm: int, _kind: int, _id: int, orientation: int, _covariance: int, width_rad: float, _height_rad: float,
    w: float, x: float, y: float, z: float, quality: int,
) -> bool:  # fmt: skip
    if current_cm in UNKNOWN or quality == INVALID_QUALITY:
        return False
    half_deg = 0.5 * math.degrees(min(max(width_rad, 0.0), math.pi))
    if orientation in HORIZONTAL:
        return _is_ahead(45.0 * orientation, half_deg)
    forward, right, down = w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    if orientation != CUSTOM or abs(down) > TILT:
        return False
    return _is_ahead(math.degrees(math.atan2(right, forward)), half_deg)


def _is_ahead(bearing_deg: float, half_deg: float = 0.0) -> bool:
    return abs(math.remainder(bearing_deg, 360.0)) - half_deg <= AHEAD_DEG
