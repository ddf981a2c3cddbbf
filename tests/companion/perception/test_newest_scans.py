"""Of range data that piles up within a tick the newest of each sensor."""

from __future__ import annotations

import math

import numpy as np

from companion.core.scan import RangeScan
from companion.perception.newest_scans import MOST_SCANS, SAME, newest_ranges
from companion.vehicle.events import (
    Event,
    RangeSeen,
    TextSeen,
)


def seen(time_s: float, source: str = "obstacle distance", bearing_deg: float = 0.0, sender: int = 1) -> RangeSeen:
    scan = RangeScan(time_s, np.array([math.radians(bearing_deg)]), np.array([3.0]), 0.2, 8.0, 0.1, source, sender)
    return RangeSeen(time_s, scan)


def test_what_comes_in_an_ordinary_tick_is_all_taken_in() -> None:
    events: list[Event] = [seen(1.0), TextSeen(1.0, 6, "a"), *(seen(1.0, "sector 10", 45.0 * i) for i in range(8))]
    events += [seen(1.0), seen(1.0, "rangefinder")]
    assert newest_ranges(events) == events


def test_of_a_flood_the_newest_of_each_kind_remain_in_their_order() -> None:
    flood: list[Event] = [seen(float(i)) for i in range(50)]
    beam = seen(0.5, "distance sensor 1", 90.0)
    kept = newest_ranges([beam, *flood, TextSeen(50.0, 6, "a")])
    assert kept == [beam, *flood[-SAME:], TextSeen(50.0, 6, "a")]


def test_a_flood_of_one_sender_leaves_the_same_message_of_another_in_its_place() -> None:
    lidar = seen(0.0, sender=196)
    flood = [seen(float(i), f"distance sensor {i % 6}", sender=158) for i in range(50)]
    again = [seen(float(i), sender=158) for i in range(50)]
    kept = newest_ranges([lidar, *flood, *again])
    assert kept[0] is lidar and len(kept) == MOST_SCANS and kept[-SAME:] == again[-SAME:]


def test_kinds_without_end_are_too_many_and_nothing_but_range_data_is_left_out() -> None:
    texts = [TextSeen(float(i), 6, "a") for i in range(100)]
    kept = newest_ranges([*texts, *(seen(float(i), f"distance sensor {i}") for i in range(250))])
    assert kept[:100] == texts
    assert [event.time_s for event in kept[100:]] == [float(i) for i in range(250 - MOST_SCANS, 250)]
