"""Notices a range sensor that repeats itself: the same readings again and again although the rover moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.core.scan import RangeScan
from companion.vehicle.state import VehicleState

STUCK_S = 0.5
"""Many drivers send faster than their sensor measures: the same readings for less than this are nothing."""
STUCK_M = 0.25
STUCK_RAD = math.radians(10.0)
"""The rover must have come so far, or turned by so much, with one and the same readings."""
FEW_M = 1.0
"""The same for a scan with few different ranges, which a wall beside the way may well give for a while."""
STALE_SHARE = 0.2
"""From this share of it on what is repeated no longer fits the place, and is not put on the map."""
MOVES_M_S, TURNS_RAD_S = 0.2, math.radians(5.0)
"""Slower than this counts as standing: velocities are noisy, and a rover that stands may well see the same all day."""
OWN_BODY_M = 0.6
"""A mast in the sensor's way gives the same reading for ever; so near, readings say nothing of the world."""
DISTINCT = 5
"""So many different ranges do not repeat by chance, not even rounded to centimetres between parallel walls."""
THIN_RAD = math.radians(10.0)
"""A beam no wider than this looks along one line: what it hits straight ahead comes nearer as the rover does."""
AHEAD_RAD = math.radians(15.0)
NEAREST_OF_ALL = "rangefinder"
"""RANGEFINDER: the nearest of all sensors, whichever way that one looks."""
FORGOTTEN_S = 5.0
"""A sensor that has fallen silent for so long is no longer held against anybody: then its silence counts."""


@dataclass(slots=True)
class _Repeats:
    """The newest readings of one sensor, and how long and far the rover has carried them about."""

    scan: RangeScan
    since_s: float
    moved_m: float = 0.0
    turned_rad: float = 0.0
    stuck: bool = False


class ScanWatch:
    """One record for every sensor, by its sender and the name that its scans bear."""

    def __init__(self) -> None:
        self._last: dict[tuple[int, str], _Repeats] = {}
        self._moved_s: float | None = None
        self._newest_s = -math.inf

    @property
    def repeating(self) -> str | None:
        """The sensor that repeats itself, so that it cannot be believed; None when there is none."""
        for (_, source), one in self._last.items():
            if one.stuck and self._newest_s - one.scan.time_s < FORGOTTEN_S:
                return source
        return None

    def take(self, scan: RangeScan, vehicle: VehicleState) -> bool:
        """Take note of a scan. Returns whether it fits the place where the rover is now."""
        self._move(scan.time_s, vehicle)
        self._newest_s = scan.time_s
        last = self._last.get(scan.voice)
        if last is None or not _same(last.scan, scan):
            self._last[scan.voice] = _Repeats(scan, scan.time_s)
            return True
        last.scan = scan
        by_way_m, by_turn_rad = _telling(scan)
        long = scan.time_s - last.since_s >= STUCK_S
        turned_rad = abs(last.turned_rad)
        last.stuck = last.stuck or (long and (last.moved_m >= by_way_m or turned_rad >= by_turn_rad))
        return not (last.stuck or last.moved_m > STALE_SHARE * by_way_m or turned_rad > STALE_SHARE * by_turn_rad)

    def _move(self, now_s: float, vehicle: VehicleState) -> None:
        """By the velocities, not by the position, which wanders while the rover stands."""
        before_s, self._moved_s = self._moved_s, now_s
        if before_s is None or vehicle.attitude is None:
            return
        elapsed_s = min(now_s - before_s, 1.0)
        speed_m_s, rate_rad_s = vehicle.speed_m_s, vehicle.attitude.yaw_rate_rad_s
        for one in self._last.values():
            one.moved_m += speed_m_s * elapsed_s if speed_m_s > MOVES_M_S else 0.0
            one.turned_rad += rate_rad_s * elapsed_s if abs(rate_rad_s) > TURNS_RAD_S else 0.0


def _same(one: RangeScan, other: RangeScan) -> bool:
    return len(one.range_m) == len(other.range_m) and bool(np.array_equal(one.range_m, other.range_m, equal_nan=True))


def _telling(scan: RangeScan) -> tuple[float, float]:
    """How far the rover may drive, and by how much turn, while these readings stay as they are; inf: as it likes.

    Readings need not change where nothing was seen, beside a wall that the rover follows, and in the round of a wide sonar.
    """
    seen = np.isfinite(scan.range_m) & (scan.range_m > OWN_BODY_M)
    different = len(set(scan.range_m[seen].tolist()))
    if different > 1:
        return (STUCK_M if different >= DISTINCT else FEW_M), STUCK_RAD
    thin = len(scan.bearing_rad) * scan.beam_width_rad <= THIN_RAD
    if not thin or different == 0 or scan.source == NEAREST_OF_ALL:
        return math.inf, math.inf
    aside_rad = abs(math.remainder(float(scan.bearing_rad[0]), math.pi))
    return (STUCK_M if aside_rad <= AHEAD_RAD else math.inf), STUCK_RAD
