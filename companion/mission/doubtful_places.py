"""Doubtful places: targets far from home, latitude and longitude that seem to have been swapped, home at the edge."""

from __future__ import annotations

import math

from companion.core.frames import GeoPoint
from companion.mission.mission import HomePoint, Mission

FAR_M = 1000.0
"""A target farther from home than this is told of."""
SWAPPED_SHARE = 0.1
"""The other way round, a swapped place is nearer to home by this share at least."""
NOWHERE = GeoPoint(0.0, 0.0)
"""Where programs put places that nobody told them."""
EARTH_M = 6_371_000.0


def doubtful_places(mission: Mission, home: GeoPoint | None = None) -> list[str]:
    """A line for each target that is far from home: how far, and whether the other way round it would be near.

    ``home``: the autopilot's; None: the file's own. Without one, targets in degrees count from the first of them.
    """
    return [line for _, line in _doubts(mission, home)]


def home_at_edge(mission: Mission) -> list[str]:
    """A line if the rover reaches over the edge of the mission's grid where it begins."""
    grid, reach_m = mission.grid, mission.rover.radius_m
    if grid.size is None or grid.home is None:
        return []
    fields = min(*grid.home, grid.size[0] - 1 - grid.home.x, grid.size[1] - 1 - grid.home.y)
    edge_m = (fields + 0.5) * grid.resolution_m
    if reach_m <= edge_m:
        return []
    return [
        f"home is {edge_m:g} m from the edge of the grid, and the rover reaches {reach_m:.2f} m round its place: it "
        "may not be able to begin; put grid.home farther inside, or leave out grid.size"
    ]


def most_doubtful(mission: Mission, home: GeoPoint) -> str:
    """The line of the target that is farthest from home; empty if none is far."""
    return max(_doubts(mission, home), default=(0.0, ""))[1]


def _doubts(mission: Mission, home: GeoPoint | None) -> list[tuple[float, str]]:
    places = [target.place for target in mission.targets]
    first = next((place for place in places if isinstance(place, GeoPoint)), None)
    own = mission.planned_home or (mission.sitl.home if mission.sitl is not None else None)
    zero, name = (home or own, "home") if home or own else (first, "the first target in degrees")
    doubts = []
    for number, target in enumerate(mission.targets, start=1):
        what, place = f"target {number} '{target.name}'", target.place
        if isinstance(place, HomePoint):
            far_m = math.hypot(place.north_m, place.east_m)
            if far_m > FAR_M:
                doubts.append((far_m, f"{what} is {distance_text(far_m)} from home; is that meant?"))
        elif place == NOWHERE:
            doubts.append((math.inf, f"{what} is at latitude 0, longitude 0, in the sea; is that meant?"))
        elif isinstance(place, GeoPoint) and zero is not None and (line := _doubt(place, zero, name)):
            doubts.append((great_circle_m(place, zero), f"{what} {line}"))
    return doubts


def _doubt(place: GeoPoint, zero: GeoPoint, name: str) -> str:
    """What is doubtful about a place in degrees; empty if nothing is."""
    far_m = great_circle_m(place, zero)
    if far_m <= FAR_M:
        return ""
    far = f"is {distance_text(far_m)} from {name}"
    if abs(place.lon_deg) <= 90.0:
        turned_m = great_circle_m(GeoPoint(place.lon_deg, place.lat_deg), zero)
        if turned_m < SWAPPED_SHARE * far_m:
            turned = f"the other way round it is {distance_text(turned_m)} away"
            return f"{far}; latitude and longitude seem swapped ({turned}), is that meant?"
    return f"{far}; is that meant?"


def distance_text(distance_m: float) -> str:
    """In metres, or kilometres."""
    if distance_m < 995.0:
        return f"{distance_m:.0f} m"
    return f"{distance_m / 1000.0:.1f} km" if distance_m < 99_950.0 else f"{distance_m / 1000.0:.0f} km"


def great_circle_m(here: GeoPoint, there: GeoPoint) -> float:
    """The distance on a sphere, to half a percent: for places that may be anywhere."""
    lats = math.radians(here.lat_deg), math.radians(there.lat_deg)
    lat_rad, lon_rad = lats[1] - lats[0], math.radians(there.lon_deg - here.lon_deg)
    half = math.sin(lat_rad / 2.0) ** 2 + math.cos(lats[0]) * math.cos(lats[1]) * math.sin(lon_rad / 2.0) ** 2
    return 2.0 * EARTH_M * math.asin(min(1.0, math.sqrt(half)))
