"""What the three range messages say, as RangeScan; the only place that knows their units and their special values.

Rules (ArduRover's behaviour and the MAVLink definitions; where they leave room, the safe reading):

- A reading at or beyond the sensor's maximum is "nothing seen up to the maximum" (``inf``), never an obstacle.
- A reading between zero and the minimum is an obstacle at that distance: in doubt the rover stops.
- Zero, 65535 and signal quality 1 are "unknown" (``nan``). MAVLink calls a zero of OBSTACLE_DISTANCE "touching", but drivers
  fill unused cells with it and ArduPilot itself passes over it; unknown is safe, for ground that has not been seen is not
  driven on, and an obstacle that came near was on the map before.
- A message in which all is unknown is no scan at all, so that range data grows stale and the rover stops.
- A wide beam says "somewhere in here": it is given as several narrow ones of the same range.
- Orientations count clockwise (1 is right-front); the text of common.xml says the reverse, ArduPilot does not.
- OBSTACLE_DISTANCE is taken as relative to the rover whatever its frame field says, as ArduPilot does: most drivers
  leave the field at 0, which would mean north.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from companion.core.scan import RangeScan

UNKNOWN_CM = 65535
INVALID_QUALITY = 1
HORIZONTAL = range(8)
CUSTOM_ORIENTATION = 100
MAX_TILT_RAD = math.radians(15.0)
SECTOR_IDS = range(10, 18)
SECTOR_RAD = math.radians(45.0)
OWN_BEAM_RAD = math.radians(4.0)
"""Width of a rangefinder that does not state its own (small laser rangefinders have 2 to 4 degrees)."""
NARROW_RAD = math.radians(6.0)
"""Wider beams are given as several."""
RANGEFINDER_MIN_M, RANGEFINDER_TRUST_M = 0.2, 5.0
"""RANGEFINDER does not state its limits: beyond the second figure it is taken as nothing seen."""


def distance_sensor(message: Any, time_s: float, *, sector: bool) -> RangeScan | None:
    """DISTANCE_SENSOR: one beam, or one of the autopilot's 45-degree proximity sectors; None if not horizontal or unknown."""
    bearing_rad = _bearing_rad(message)
    if bearing_rad is None or message.max_distance <= message.min_distance:
        return None
    distance = message.current_distance
    if message.signal_quality == INVALID_QUALITY or distance in (0, UNKNOWN_CM):
        return None
    width_rad = message.horizontal_fov if 0.0 < message.horizontal_fov <= math.pi else OWN_BEAM_RAD
    return _scan(
        time_s,
        np.array([bearing_rad]),
        np.array([math.inf if distance >= message.max_distance else distance / 100.0]),
        message.min_distance / 100.0,
        message.max_distance / 100.0,
        SECTOR_RAD if sector else width_rad,
        f"{'sector' if sector else 'distance sensor'} {message.id}",
    )


def obstacle_distance(message: Any, time_s: float) -> RangeScan | None:
    """OBSTACLE_DISTANCE: up to 72 cells; None if all are unknown or the message makes no sense."""
    step_deg = message.increment_f if message.increment_f else float(message.increment)
    # A field of any width would be laid out in as many beams as it takes: more than a full turn is no width.
    if not (0.0 < abs(step_deg) <= 360.0 and abs(message.angle_offset) <= 360.0):
        return None
    # More cells than make a full turn would speak of the same place twice.
    cells = min(len(message.distances), max(1, round(360.0 / abs(step_deg))))
    distance = np.asarray(message.distances[:cells], np.float64)
    unknown = (distance == 0.0) | (distance == UNKNOWN_CM)
    if message.max_distance == 0 or message.max_distance <= message.min_distance or unknown.all():
        return None
    range_m = np.where(unknown, np.nan, np.where(distance >= message.max_distance, np.inf, distance / 100.0))
    bearing_rad = np.radians(message.angle_offset + step_deg * np.arange(cells))
    return _scan(
        time_s,
        bearing_rad,
        range_m,
        message.min_distance / 100.0,
        message.max_distance / 100.0,
        math.radians(abs(step_deg)),
        "obstacle distance",
    )


def rangefinder(message: Any, time_s: float) -> RangeScan | None:
    """RANGEFINDER, the last resort: the nearest of all sensors in whatever direction, taken as one narrow beam ahead.

    So an obstacle at the side stops the rover as well, while only the ground straight ahead counts as free.
    """
    distance_m = message.distance
    if not math.isfinite(distance_m) or distance_m <= 0.0:
        return None
    range_m = math.inf if distance_m >= RANGEFINDER_TRUST_M else distance_m
    beam = np.array([0.0])
    return _scan(time_s, beam, np.array([range_m]), RANGEFINDER_MIN_M, RANGEFINDER_TRUST_M, OWN_BEAM_RAD, "rangefinder")


def is_sector(message: Any) -> bool:
    """Whether a DISTANCE_SENSOR of the autopilot is a proximity sector rather than a sensor of its own."""
    return message.id in SECTOR_IDS and message.orientation in HORIZONTAL


def _bearing_rad(message: Any) -> float | None:
    """Clockwise from ahead, or None for a sensor that does not look along the ground."""
    if message.orientation in HORIZONTAL:
        return float(message.orientation) * math.radians(45.0)
    if message.orientation != CUSTOM_ORIENTATION:
        return None
    w, x, y, z = message.quaternion
    norm = w * w + x * x + y * y + z * z
    if not math.isfinite(norm) or not 0.5 < norm < 1.5:
        return None
    # Where the sensor's x-axis points in the rover's frame (forward, right, down).
    forward, right, down = w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    if abs(math.asin(max(-1.0, min(1.0, down / norm)))) > MAX_TILT_RAD:
        return None
    return math.atan2(right, forward)


def _scan(
    time_s: float,
    bearing_rad: np.ndarray[Any, np.dtype[np.float64]],
    range_m: np.ndarray[Any, np.dtype[np.float64]],
    min_range_m: float,
    max_range_m: float,
    width_rad: float,
    source: str,
) -> RangeScan:
    parts = max(1, math.ceil(width_rad / NARROW_RAD - 1e-9))
    if parts > 1:
        offsets = ((np.arange(parts) + 0.5) / parts - 0.5) * width_rad
        bearing_rad = (bearing_rad[:, None] + offsets).ravel()
        range_m = np.repeat(range_m, parts)
    return RangeScan(time_s, bearing_rad, range_m, min_range_m, max_range_m, width_rad / parts, source)
