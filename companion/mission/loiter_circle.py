"""NAV_LOITER_TURNS as places: a circle is driven as a polygon of so many corners that it stays close to it.

ArduRover drives to the edge, on the line from the centre to where it is, and then along it (ModeCircle).

Nouns: loiter circle.
"""

from __future__ import annotations

import math

from companion.core.frames import GeoPoint, LocalFrame, NedPoint

OFF_CIRCLE_M = 0.5
"""The middles of the polygon's sides are no farther inside the circle."""
FEWEST, MOST = 8, 72
"""Corners of a whole turn."""
SMALLEST_M = 0.5
"""A smaller circle is a place."""


def corners(centre: GeoPoint, radius_m: float, turns: float, coming_from: GeoPoint | None) -> list[GeoPoint]:
    """The places to drive to, from the edge on. ``radius_m`` is negative for a circle counterclockwise.

    ``coming_from``: where the rover is before (None, or the centre: the circle begins in the north).
    """
    if turns <= 0.0:
        return []
    size_m, frame = abs(radius_m), LocalFrame(centre)
    if size_m < SMALLEST_M:
        return [centre]
    before = NedPoint(0.0, 0.0) if coming_from is None else frame.to_ned(coming_from)
    start_rad = math.atan2(before.east_m, before.north_m)
    a_turn = min(max(math.ceil(math.pi / math.acos(max(1.0 - OFF_CIRCLE_M / size_m, 0.0))), FEWEST), MOST)
    steps = max(math.ceil(turns * a_turn - 1e-9), 1)
    step_rad = math.copysign(2.0 * math.pi * turns / steps, radius_m)
    bearings = [start_rad + number * step_rad for number in range(steps + 1)]
    return [frame.to_geo(NedPoint(size_m * math.cos(rad), size_m * math.sin(rad))) for rad in bearings]
