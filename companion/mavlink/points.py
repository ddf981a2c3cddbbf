"""Points of OBSTACLE_DISTANCE_3D, one message each, joined into scans: what a depth camera sees, seen from above.

Rules (the MAVLink definitions and what ArduPilot does with them; where these are silent, the safe interpretation):

- The frame is that of the rover's body (forward, right, down). Points in other frames are not used.
- Points of one component and sensor type with the same time stamp and the same limits are one look of its sensor. It is
complete when a point with another stamp comes, or when the next bytes after it bring no more of it. - A point counts
if its height is that of something the rover could touch. Others, the ground for example, say nothing. - A point at or
beyond the sensor's maximum means "nothing up to the maximum" in that direction; one nearer than the minimum is an
obstacle all the same. - A direction in which there is an obstacle at any height is not free. - Directions without a
point are unknown, so ground there counts as not seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.scan import RangeScan

MESSAGE = mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE_3D
SECTORS = 72
SECTOR_RAD = 2.0 * math.pi / SECTORS
"""A point speaks for this width: the direction of its sector, not its own."""
MOST_SENSORS = 20
MOST_M = 1000.0


@dataclass(frozen=True, slots=True)
class Band:
    """The heights of points that count, in metres above and below the rover's own origin."""

    above_m: float
    below_m: float


@dataclass(frozen=True, slots=True)
class Look:
    """What the points of one look have in common."""

    stamp_ms: int
    min_m: float
    max_m: float


@dataclass(slots=True)
class _Open:
    """A look that may not be complete. ``range_m``: by sectors clockwise from straight behind; nan is unknown."""

    look: Look
    heard_s: float
    told: bool = False
    range_m: NDArray[np.float64] = field(default_factory=lambda: np.full(SECTORS, np.nan, dtype=np.float64))


class PointJoiner:
    """Joins points into scans. ``band``: the heights that count."""

    def __init__(self, band: Band) -> None:
        self._band = band
        self._open: dict[tuple[int, int], _Open] = {}

    def add(self, message: Any, time_s: float, sender: int) -> RangeScan | None:
        """Take in one point. Returns the scan of the look before it, if this point begins another one."""
        look, key = look_of(message), (sender, message.sensor_type)
        if look is None:
            return None
        before, scan = self._open.get(key), None
        if before is None or before.look != look:
            scan = None if before is None else _told(before, key)
            if before is None and len(self._open) >= MOST_SENSORS:
                del self._open[next(iter(self._open))]
            self._open[key] = before = _Open(look, time_s)
        before.heard_s = time_s
        if (seen := seen_at(message, look, self._band)) is not None:
            sector, range_m = seen
            before.range_m[sector] = np.fmin(before.range_m[sector], range_m)
            before.told = False
        return scan

    def complete(self, now_s: float) -> list[RangeScan]:
        """The scans of looks whose last point came with earlier bytes than these, which arrive at ``now_s``."""
        waiting = [(key, one) for key, one in self._open.items() if not one.told and one.heard_s < now_s]
        return [scan for key, one in waiting if (scan := _told(one, key)) is not None]


def look_of(message: Any) -> Look | None:
    """What tells the look of a point from others; None for a point that cannot be used."""
    limits = (message.min_distance, message.max_distance)
    numbers = (*limits, message.x, message.y, message.z)
    if message.frame != mavlink.MAV_FRAME_BODY_FRD or not all(map(math.isfinite, numbers)):
        return None
    return Look(message.time_boot_ms, *limits) if 0.0 <= limits[0] < limits[1] <= MOST_M else None


def seen_at(message: Any, look: Look, band: Band) -> tuple[int, float] | None:
    """The sector of a point, and its range along the ground (``inf``: nothing up to the maximum).

    None for one that says nothing.
    """
    across_m = math.hypot(message.x, message.y)
    if across_m == 0.0 or not -band.above_m <= message.z <= band.below_m:
        return None
    # A maximum that was rounded to a float on the way is still the maximum.
    nothing = math.hypot(across_m, message.z) >= look.max_m * (1.0 - 1e-6)
    return sector_of(math.atan2(message.y, message.x)), math.inf if nothing else across_m


def sector_of(bearing_rad: float) -> int:
    """The sector in which a bearing (-pi to pi, clockwise from ahead) lies; the first begins straight behind."""
    return int((bearing_rad + math.pi) / SECTOR_RAD) % SECTORS


def _told(one: _Open, key: tuple[int, int]) -> RangeScan | None:
    """The scan of a look; None if it has been told already, or says nothing."""
    known = np.flatnonzero(~np.isnan(one.range_m))
    if one.told or len(known) == 0:
        return None
    one.told = True
    part = slice(known[0], known[-1] + 1)
    bearing_rad = (np.arange(SECTORS, dtype=np.float64) + 0.5) * SECTOR_RAD - math.pi
    limits = (one.look.min_m, one.look.max_m)
    sender, kind = key
    range_m, source, told_s = one.range_m[part].copy(), f"obstacle points {kind}", one.look.stamp_ms * 1e-3
    return RangeScan(one.heard_s, bearing_rad[part], range_m, *limits, SECTOR_RAD, source, sender, told_s=told_s)
