"""Which range data is live: an autopilot sends much of what it is told, or measures, a second time in a coarser form."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink import ranges
from companion.scan import RangeScan

MESSAGES = (mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE)
ECHO_S = 2.0
"""For so long after a message, what repeats its readings in a coarser form is left out."""


class LiveRanges:
    """Remembers when each source was heard last, and leaves out its echoes."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._cells_s = -math.inf
        self._other_range_s = -math.inf
        self._beam_s: dict[int, float] = {}

    def begin(self, time_s: float) -> None:
        """The vehicle is heard: the first time counts."""
        if self._first_s is None:
            self._first_s = time_s

    def scan(self, message: Any, time_s: float, *, of_autopilot: bool) -> RangeScan | None:
        """What one of ``MESSAGES`` tells; None when it is an echo, or of no use."""
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
            scan = ranges.obstacle_distance(message, time_s)
            self._cells_s = time_s if scan is not None else self._cells_s
        else:
            scan = self._distance_sensor(message, of_autopilot, time_s)
        if scan is not None:
            self._other_range_s = time_s
        return scan

    def _distance_sensor(self, message: Any, of_autopilot: bool, time_s: float) -> RangeScan | None:
        """Leaves out proximity sectors that only echo finer data: a lidar's cells, or a rangefinder that looks the same way."""
        if of_autopilot and ranges.is_sector(message):
            finer_s = max(self._cells_s, self._beam_s.get(message.orientation, -math.inf))
            return None if time_s - finer_s < ECHO_S else ranges.distance_sensor(message, time_s, sector=True)
        scan = ranges.distance_sensor(message, time_s, sector=False)
        if scan is not None:
            self._beam_s[message.orientation] = time_s
        return scan

    def rangefinder(self, message: Any, time_s: float) -> RangeScan | None:
        """RANGEFINDER counts only when nothing better has been heard for a while."""
        assert self._first_s is not None
        if time_s - max(self._other_range_s, self._first_s) < ECHO_S:
            return None
        return ranges.rangefinder(message, time_s)
