"""Fence and rally items as areas and points: polygons (several items each), circles, rally points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.core.frames import GeoPoint
from companion.mission import mav_commands as mav
from companion.mission.items import MAX_ITEMS, Item, ItemError, geo_point
from companion.mission.mission import Area, open_ring


@dataclass
class Fences:
    """The areas found so far, and notes about items that are not used."""

    keep_in: list[Area] = field(default_factory=list)
    keep_out: list[Area] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class FenceAreas:
    """The areas of a list of fence items: the rover must stay inside ``keep_in`` and outside each of ``keep_out``."""

    keep_in: tuple[Area, ...] = ()
    keep_out: tuple[Area, ...] = ()


def fence_areas(items: Sequence[Item]) -> FenceAreas:
    """The areas of a fence alone. Raises ItemError with the item's index and its command."""
    fences = fences_of(items)
    return FenceAreas(tuple(fences.keep_in), tuple(fences.keep_out))


def rally_points(items: Sequence[Item]) -> tuple[GeoPoint, ...]:
    """The places of rally items, in order. Raises ItemError."""
    for item in items:
        if item.command != mav.RALLY_POINT:
            raise ItemError(f"{item.label}: is no rally point")
    return tuple(geo_point(item.lat_deg, item.lon_deg, item.label) for item in items)


def circle(centre: GeoPoint, radius_m: float, what: str) -> Area:
    """A round fence. Raises ItemError."""
    if not (math.isfinite(radius_m) and radius_m > 0.0):
        raise ItemError(f"{what}: a radius of {radius_m} m encloses nothing")
    return Area((centre,), radius_m=radius_m)


def is_fence(item: Item) -> bool:
    """Whether an item belongs to a fence, or is a rally point."""
    return mav.FENCE_RETURN_POINT <= item.command <= mav.RALLY_POINT


def fences_of(items: Sequence[Item]) -> Fences:
    """The areas of fence items, and notes about items that are not used. Raises ItemError with index and command."""
    fences = Fences()
    i = 0
    while i < len(items):
        item = items[i]
        place = geo_point(item.lat_deg, item.lon_deg, item.label)
        if item.command in (mav.FENCE_POLYGON_IN, mav.FENCE_POLYGON_OUT):
            corners = _corners(items, i)
            area = Area(open_ring(tuple(corners)))
            (fences.keep_in if item.command == mav.FENCE_POLYGON_IN else fences.keep_out).append(area)
            i += len(corners)
            continue
        if item.command in (mav.FENCE_CIRCLE_IN, mav.FENCE_CIRCLE_OUT):
            area = circle(place, item.param(1), item.label)
            (fences.keep_in if item.command == mav.FENCE_CIRCLE_IN else fences.keep_out).append(area)
        elif item.command == mav.FENCE_RETURN_POINT:
            fences.notes.append(f"{item.label}: the rover stays inside its fences and needs no return point")
        elif item.command == mav.RALLY_POINT:
            fences.notes.append(f"{item.label}: rally point {place.lat_deg:.7f}, {place.lon_deg:.7f} is not used")
        else:
            raise ItemError(f"{item.label}: not understood")
        i += 1
    return fences


def _corners(items: Sequence[Item], first: int) -> list[GeoPoint]:
    """The corners of one polygon: its vertex items are consecutive, and each holds their number."""
    item = items[first]
    count = item.param(1)
    if not math.isfinite(count) or count != int(count) or not 3 <= count <= MAX_ITEMS:
        raise ItemError(f"{item.label}: a polygon of {count:g} corners")
    corners = items[first : first + int(count)]
    for corner in corners:
        if corner.command != item.command or corner.param(1) != count:
            raise ItemError(f"{corner.label}: the polygon from item {item.index} on should have {count:g} corners")
    if len(corners) < count:
        raise ItemError(f"{item.label}: the polygon has {len(corners)} of its {count:g} corners")
    return [geo_point(corner.lat_deg, corner.lon_deg, corner.label) for corner in corners]
