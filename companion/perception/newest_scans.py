"""Of range data that piles up within one tick only the newest of each sensor is taken in: a flood must not cost a tick its time."""

from __future__ import annotations

import math
from collections.abc import Sequence

from companion.core.scan import RangeScan
from companion.vehicle.events import (
    Event,
    RangeSeen,
)

MOST_SCANS = 20
"""In one tick, and of so many sensors at all: eight sectors, as many beams, and lidars."""
SAME = 3
"""So many of one sensor are still taken in: two that nothing tells apart may send the same message."""

Sensor = tuple[int, str, int]
"""What a sensor is told apart by: who sent it, what message it came in and into which eighth of a circle it begins to look."""


def newest_ranges(events: Sequence[Event]) -> list[Event]:
    """The events without range data that newer data of the same sensor in the same tick has overtaken; order kept.

    Of each sensor the newest comes first, then of each the second: one that floods takes nobody else's place.
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
    """Of the sensor that this scan comes from."""
    return *scan.voice, round(math.degrees(float(scan.bearing_rad[0])) / 45.0) % 8
