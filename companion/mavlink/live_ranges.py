"""Which range data is live: an autopilot sends much of what it is told, or measures, a second time in a coarser form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.scan import RangeScan
from companion.mavlink import ranges
from companion.perception.scan_filter import MOST_SCANS, Sensor, sensor_of

AUTOPILOT = 1
"""Its component id."""

MESSAGES = (mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE)
FORGOTTEN_S = 5.0
"""No more sensors are heeded than scans in a tick, those first that were there first: one that is silent for so long gives up its place."""
ECHO_S = 2.0
"""For so long after a message, what repeats its readings in a coarser form is left out."""


class LiveRanges:
    """Remembers when each source was heard last, and leaves out its echoes."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._cells_s = -math.inf
        self._other_range_s = -math.inf
        self._beam_s: dict[int, float] = {}
        self._seen_s: dict[int, float] = {}
        """When finer data than sectors last showed something, by eighths of the circle."""
        self._heard_s: dict[Sensor, float] = {}
        """When each sensor was heard last."""

    def begin(self, time_s: float) -> None:
        """The vehicle is heard: the first time counts."""
        if self._first_s is None:
            self._first_s = time_s

    def scan(self, message: Any, time_s: float, sender: int) -> RangeScan | None:
        """What one of ``MESSAGES`` tells; None when it is an echo, of no use, or one sensor too many."""
        cells = message.get_msgId() == mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE
        sector = not cells and sender == AUTOPILOT and ranges.is_sector(message)
        if cells:
            scan = ranges.obstacle_distance(message, time_s)
        else:
            scan = ranges.distance_sensor(message, time_s, sector=sector)
        if scan is None or (sector and self._is_echo(message.orientation, scan)):
            return None
        scan = replace(scan, sender=sender)
        if not self._is_heeded(sensor_of(scan), time_s):
            return None
        self._other_range_s = time_s
        if cells:
            self._cells_s = time_s
        elif not sector:
            self._beam_s[message.orientation] = time_s
        if not sector:
            self._seen_s.update((eighth, time_s) for eighth in _eighths(scan))
        return scan

    def _is_echo(self, orientation: int, sector: RangeScan) -> bool:
        """Whether a proximity sector only repeats finer data: a lidar's cells, or a rangefinder that looks the same way.

        What that has not shown, the autopilot has from a sensor of its own.
        """
        near = [self._seen_s.get((orientation + aside) % 8, -math.inf) for aside in (-1, 0, 1)]
        finer_s = max(self._cells_s, self._beam_s.get(orientation, -math.inf))
        if np.isfinite(sector.range_m).any():
            finer_s = min(finer_s, max(near))
        return sector.time_s - finer_s < ECHO_S

    def _is_heeded(self, sensor: Sensor, time_s: float) -> bool:
        """Whether there is a place for this sensor, and it has it now."""
        if sensor not in self._heard_s and len(self._heard_s) >= MOST_SCANS:
            self._heard_s = {one: heard_s for one, heard_s in self._heard_s.items() if time_s - heard_s < FORGOTTEN_S}
            if len(self._heard_s) >= MOST_SCANS:
                return False
        self._heard_s[sensor] = time_s
        return True

    def rangefinder(self, message: Any, time_s: float) -> RangeScan | None:
        """RANGEFINDER counts only when nothing better has been heard for a while."""
        assert self._first_s is not None
        if time_s - max(self._other_range_s, self._first_s) < ECHO_S:
            return None
        return ranges.rangefinder(message, time_s)


def _eighths(scan: RangeScan) -> set[int]:
    """In which eighths of the circle, clockwise from ahead, it sees something."""
    seen = np.degrees(scan.bearing_rad[np.isfinite(scan.range_m)])
    return set((np.rint(seen / 45.0).astype(int) % 8).tolist())
