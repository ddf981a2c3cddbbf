"""Fences as areas: what lies inside a polygon or circle, and whether a place is allowed (behaviour of AC_PolyFence_loader)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sitl.autopilot.items import FENCE_CIRCLE_IN, FENCE_CIRCLE_OUT, FENCE_POLYGON_IN, FENCE_POLYGON_OUT, Item
from sitl.world import geodesy

UNION = 2
"""Bit of FENCE_OPTIONS: it is enough to be inside one of the inclusion areas."""

Place = tuple[int, int]


def inside(place: Place, corners: Sequence[Place]) -> bool:
    """Whether a place lies within a polygon of latitudes and longitudes (1e-7 degree)."""
    within = False
    lat, lon = place
    for (lat_a, lon_a), (lat_b, lon_b) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (lon_a > lon) != (lon_b > lon):
            # Whole numbers, so that a place on the border does not depend on rounding.
            side = (lat - lat_a) * (lon_b - lon_a) - (lat_b - lat_a) * (lon - lon_a)
            within ^= (side < 0) == (lon_b > lon_a)
    return within


def distance_m(place: Place, other: Place) -> float:
    """Metres between two places."""
    return math.hypot(*geodesy.offset_m(place, other))


def shapes(items: Sequence[Item]) -> list[tuple[int, Sequence[Place], float]]:
    """The items put together: command, corners (a circle's centre alone), radius in metres."""
    found: list[tuple[int, Sequence[Place], float]] = []
    at = 0
    while at < len(items):
        first = items[at]
        if first.command in (FENCE_POLYGON_IN, FENCE_POLYGON_OUT):
            size = int(first.params[0])
            found.append((first.command, [item.place for item in items[at : at + size]], 0.0))
            at += size
        else:
            found.append((first.command, [first.place], first.params[0]))
            at += 1
    return found


def outside(items: Sequence[Item], place: Place, options: int = 0) -> bool:
    """Whether the place breaches the fence: outside of an inclusion area, or within an exclusion area."""
    areas = missed = 0
    for command, corners, radius_m in shapes(items):
        if command == FENCE_POLYGON_IN:
            areas += 1
            missed += not inside(place, corners)
        elif command == FENCE_CIRCLE_IN:
            areas += 1
            missed += distance_m(place, corners[0]) > radius_m
        elif (command == FENCE_POLYGON_OUT and inside(place, corners)) or (
            command == FENCE_CIRCLE_OUT and distance_m(place, corners[0]) < radius_m
        ):
            return True
    return missed == areas > 0 if options & UNION else missed > 0


def nearest(place: Place, places: Sequence[Place]) -> Place | None:
    """The nearest of some places."""
    return min(places, key=lambda one: distance_m(place, one), default=None)
