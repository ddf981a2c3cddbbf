"""Of range data that piles up within one tick only the newest of each sensor is taken in: a flood must not cost a tick its time."""

from __future__ import annotations

import math
from collections.abc import Sequence

from companion.events.event import Event
from companion.events.vehicle import RangeSeen
from companion.scan import RangeScan

MOST_SCANS = 16
"""In one tick: eight sectors or beams, a lidar and as many again; the oldest are left out."""
SAME = 3
"""So many of one kind are still taken in: two lidars may send the same message."""


def newest_ranges(events: Sequence[Event]) -> list[Event]:
    """The events without range data that newer data of the same kind and direction in the same tick has overtaken; order kept."""
    left: dict[tuple[str, int], int] = {}
    kept: list[Event] = []
    scans = 0
    for event in reversed(events):
        if isinstance(event, RangeSeen):
            key = _kind(event.scan)
            left[key] = left.get(key, SAME) - 1
            if left[key] < 0 or scans >= MOST_SCANS:
                continue
            scans += 1
        kept.append(event)
    return kept[::-1]


def _kind(scan: RangeScan) -> tuple[str, int]:
    """What message it came in and, to some ten degrees, where it begins to look."""
    return scan.source, round(math.degrees(float(scan.bearing_rad[0])) / 10.0)
