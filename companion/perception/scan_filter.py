"""Scan filter: of a flood of scans the newest of each sensor, and notice of a sensor that repeats itself.

Of range data that piles up within one tick only the newest of each sensor is taken in, so that a flood does not
cost a tick its time. A sensor repeats itself when it sends the same readings again and again although the rover
moves.

Nouns: scan filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.scan import WIRED, RangeScan
from companion.vehicle.events import (
    Event,
    RangeSeen,
)
from companion.vehicle.state import VehicleState

MOST_SCANS = 20
"""In one tick, and of this many sensors at most: eight sectors, as many beams, and lidars."""
SAME = 3
"""Of one sensor this many are still taken in: two sensors that nothing tells apart may send the same message."""

Sensor = tuple[int, str, int]
"""What tells sensors apart: the sender, the kind of message, and the eighth of a circle in which its readings begin."""

STUCK_S = 0.5
"""Many drivers send faster than their sensor measures: the same readings for less than this mean nothing."""
STUCK_M = 0.25
STUCK_RAD = math.radians(10.0)
"""The rover must have come this far, or turned by this much, with one and the same readings."""
FEW_M = 1.0
"""The same for a scan with few different ranges, which a wall beside the way may well give for a while."""
STALE_SHARE = 0.2
"""From this share of it on a repeated scan no longer fits the place, and is not put on the map."""
MOVES_M_S, TURNS_RAD_S = 0.2, math.radians(5.0)
"""Slower than this counts as standing: velocities are noisy, and a rover that stands may see the same all day."""
OWN_BODY_M = 0.6
"""A mast in front of the sensor gives the same reading for ever; readings this near say nothing of the world."""
DISTINCT = 5
"""This many different ranges do not repeat by chance, not even rounded to centimetres between parallel walls."""
ALIKE_RAD, ALIKE_M = math.radians(0.1), 0.002
"""Readings of two turns of a wired lidar nearer than this in bearing belong together, and in range are the same."""
MATCHED_SHARE = 0.4
"""Of the readings of a turn that is sent again, without what was lost of both, so many belong together at least."""
OTHER_SHARE, MOST_DAMAGED = 0.25, 6
"""More of those that belong together must really differ: a damaged byte does not make a stuck lidar move."""
FAR_M = 1e6
"""Stands for no echo, so that ranges can be subtracted."""
THIN_RAD = math.radians(10.0)
"""A beam no wider than this looks along one line: what it hits straight ahead comes nearer as the rover does."""
AHEAD_RAD = math.radians(15.0)
MANY = 8
"""Directions of a scan that tells more than a few sonars."""
ALONE_M, ALONG_RAD = 1.5, math.radians(80.0)
"""A single echo of such a scan, farther away than this and not straight aside, does not stay the same while the rover
drives: it is no mast, and no wall beside."""
NEAREST_OF_ALL = "rangefinder"
"""RANGEFINDER: the reading of the nearest of all sensors, whichever way that one looks."""
FORGOTTEN_S = 5.0
"""A sensor that has been silent for this long is no longer reported as repeating itself: then its silence counts."""


def newest_ranges(events: Sequence[Event]) -> list[Event]:
    """The events without range data that newer data of the same sensor in the same tick has overtaken; order kept.

    The sensors take turns: first the newest scan of each, then the second of each. So a sensor that sends too much
    takes no other sensor's place.
    """
    heard: dict[Sensor, int] = {}
    turns: list[tuple[int, int]] = []
    for place in range(len(events) - 1, -1, -1):
        event = events[place]
        if isinstance(event, RangeSeen):
            sensor = sensor_of(event.scan)
            heard[sensor] = turn = heard.get(sensor, 0) + 1
            if turn <= SAME:
                turns.append((turn, place))
    kept = {place for _, place in sorted(turns, key=lambda one: (one[0], -one[1]))[:MOST_SCANS]}
    return [event for place, event in enumerate(events) if place in kept or not isinstance(event, RangeSeen)]


def sensor_of(scan: RangeScan) -> Sensor:
    """The sensor that a scan comes from."""
    return *scan.voice, round(math.degrees(float(scan.bearing_rad[0])) / 45.0) % 8


@dataclass(slots=True)
class _Repeats:
    """The newest readings of one sensor, and how long and far the rover has carried them about."""

    scan: RangeScan
    since_s: float
    moved_m: float = 0.0
    turned_rad: float = 0.0
    stuck: bool = False


class ScanWatch:
    """Watches each sensor, by its sender and the name that its scans bear, for readings that repeat themselves."""

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
        """Note a scan. Returns whether it fits the place where the rover is now."""
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
        """Add up way and turn from the velocities, since the position wanders while the rover stands."""
        before_s, self._moved_s = self._moved_s, now_s
        if before_s is None or vehicle.attitude is None:
            return
        elapsed_s = min(now_s - before_s, 1.0)
        speed_m_s, rate_rad_s = vehicle.speed_m_s, vehicle.attitude.yaw_rate_rad_s
        for one in self._last.values():
            one.moved_m += speed_m_s * elapsed_s if speed_m_s > MOVES_M_S else 0.0
            one.turned_rad += rate_rad_s * elapsed_s if abs(rate_rad_s) > TURNS_RAD_S else 0.0


def _same(one: RangeScan, other: RangeScan) -> bool:
    """Whether a sensor repeats itself: bit for bit over the link; turn by turn, of what both tell, from a serial line.

    Lines lose bytes, so that a lidar that is stuck sends the same turns with other gaps.
    """
    if one.sender == WIRED == other.sender and len(one.range_m) and len(other.range_m):
        return _same_turn(one, other)
    return len(one.range_m) == len(other.range_m) and bool(np.array_equal(one.range_m, other.range_m, equal_nan=True))


def _same_turn(one: RangeScan, other: RangeScan) -> bool:
    order = np.argsort(one.bearing_rad, kind="stable")
    bearing_rad = one.bearing_rad[order]
    right = np.searchsorted(bearing_rad, other.bearing_rad).clip(1, max(len(bearing_rad) - 1, 1))
    right = np.minimum(right, len(bearing_rad) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.where(
        other.bearing_rad - bearing_rad[left] < bearing_rad[right] - other.bearing_rad, order[left], order[right]
    )
    before_m, now_m = one.range_m[nearer], other.range_m
    both = np.abs(one.bearing_rad[nearer] - other.bearing_rad) <= ALIKE_RAD
    both &= ~(np.isnan(before_m) | np.isnan(now_m))
    both &= np.isfinite(before_m) | np.isfinite(now_m)
    before_m, now_m = np.minimum(before_m[both], FAR_M), np.minimum(now_m[both], FAR_M)
    if len(now_m) < MATCHED_SHARE * np.isfinite(other.range_m).sum():
        return False  # other directions: what is sent again has the same ones
    differ = np.count_nonzero(np.abs(before_m - now_m) > ALIKE_M)
    return bool(differ <= min(MOST_DAMAGED, OTHER_SHARE * len(now_m)))


def _telling(scan: RangeScan) -> tuple[float, float]:
    """How far the rover may drive, and by how much turn, while these readings stay as they are; inf: without limit.

    Readings need not change where nothing was seen, beside a wall that the rover follows, and round a wide sonar.
    """
    seen = np.isfinite(scan.range_m) & (scan.range_m > OWN_BODY_M)
    different = len(set(scan.range_m[seen].tolist()))
    if different > 1:
        return (STUCK_M if different >= DISTINCT else FEW_M), STUCK_RAD
    thin = len(scan.bearing_rad) * scan.beam_width_rad <= THIN_RAD
    if np.count_nonzero(seen) == 1 and len(scan.bearing_rad) >= MANY and _lies_along(scan, seen):
        return FEW_M, STUCK_RAD
    if not thin or different == 0 or scan.source == NEAREST_OF_ALL:
        return math.inf, math.inf
    aside_rad = abs(math.remainder(float(scan.bearing_rad[0]), math.pi))
    return (STUCK_M if aside_rad <= AHEAD_RAD else math.inf), STUCK_RAD


def _lies_along(scan: RangeScan, seen: NDArray[np.bool_]) -> bool:
    """Whether all that was seen is far away, and ahead or behind rather than straight aside."""
    aside_rad = np.abs((scan.bearing_rad[seen] + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
    return bool(np.all(scan.range_m[seen] > ALONE_M) and np.all(aside_rad <= ALONG_RAD))
