"""SMART_RTL: record the path driven, simplify it, drive it back (behaviour of ModeSmartRTL, AP_SmartRTL).

Nouns: ModeSmartRTL, AP_SmartRTL.
"""

from __future__ import annotations

import math

from companion.core.severity import Severity
from sitl.autopilot.control.records import STOP
from sitl.autopilot.destination import arrived, begin_driving, drive_to, stand
from sitl.autopilot.state import Mode, SmartRtl
from sitl.autopilot.vehicle import Vehicle
from sitl.world import geodesy

SAVE_EVERY_US = 300_000

SIMPLIFY_AT = 50
"""After this many new points the path is simplified."""


def begin_smart_rtl(vehicle: Vehicle) -> None:
    """Begin SMART_RTL: brake and simplify the path."""
    begin_driving(vehicle, vehicle.parameters["RTL_SPEED"])
    path = vehicle.smart_rtl
    path.points = without_loops(simplified(path.points, _tolerance_m(vehicle)), _tolerance_m(vehicle))
    path.simplified = len(path.points)
    path.load, path.done = True, False
    vehicle.control["task"] = STOP


def run_smart_rtl(vehicle: Vehicle) -> None:
    """Drive from point to point back to where the rover was armed."""
    path = vehicle.smart_rtl
    if path.done:
        return
    if arrived(vehicle):
        path.load = True
    if not path.load:
        return
    path.load = False
    if not path.points:
        path.done = True
        stand(vehicle)
        vehicle.say(Severity.INFO, "Reached destination")
        return
    north_m, east_m = path.points.pop()
    path.simplified = min(path.simplified, len(path.points))
    after = geodesy.moved(vehicle.origin, *path.points[-1]) if path.points else None
    drive_to(vehicle, geodesy.moved(vehicle.origin, north_m, east_m), after)


def remember_start(vehicle: Vehicle) -> None:
    """Begin the path here; called on arming."""
    if vehicle.parameters["SRTL_POINTS"] <= 0.0 or vehicle.parameters["SRTL_ACCURACY"] <= 0.0:
        return
    path = vehicle.smart_rtl
    path.points = [vehicle.position_m()] if vehicle.has_position else []
    path.active = path.home_saved = vehicle.has_position
    path.simplified = 0
    path.saved_s = vehicle.time_s


def remember_path(vehicle: Vehicle) -> None:
    """Three times a second: add a point at least SRTL_ACCURACY from the last one; not in SMART_RTL itself."""
    path = vehicle.smart_rtl
    if not path.home_saved and vehicle.has_position:
        remember_start(vehicle)
    if not path.active or vehicle.mode == Mode.SMART_RTL or not vehicle.has_position:
        return
    here, last = vehicle.position_m(), path.points[-1] if path.points else None
    if last is not None and math.dist(here, last) < vehicle.parameters["SRTL_ACCURACY"]:
        path.saved_s = vehicle.time_s
        return
    most = int(min(vehicle.parameters["SRTL_POINTS"], 500.0))
    if len(path.points) - path.simplified >= SIMPLIFY_AT or len(path.points) >= most - 10:
        path.points = simplified(path.points, _tolerance_m(vehicle))
        if len(path.points) >= most - 10:
            path.points = without_loops(path.points, _tolerance_m(vehicle))
        path.simplified = len(path.points)
    if len(path.points) < most:
        path.points.append(here)
        path.saved_s = vehicle.time_s
    elif vehicle.time_s - path.saved_s > 15.0:
        _give_up(vehicle, path)


def _give_up(vehicle: Vehicle, path: SmartRtl) -> None:
    path.active = False
    vehicle.say(Severity.WARNING, "SmartRTL deactivated: buffer full")


def _tolerance_m(vehicle: Vehicle) -> float:
    """How far the simplified path may be from the recorded one, metres."""
    return float(vehicle.parameters["SRTL_ACCURACY"]) * 0.5


Point = tuple[float, float]


def simplified(points: list[Point], tolerance_m: float) -> list[Point]:
    """The path with fewer points, within the tolerance of the old one (Ramer-Douglas-Peucker)."""
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        worst, worst_m = first, tolerance_m
        for middle in range(first + 1, last):
            away_m = _from_segment_m(points[middle], points[first], points[last])
            if away_m > worst_m:
                worst, worst_m = middle, away_m
        if worst != first:
            keep.add(worst)
            stack += [(first, worst), (worst, last)]
    return [point for number, point in enumerate(points) if number in keep]


def without_loops(points: list[Point], near_m: float) -> list[Point]:
    """The path without loops: what lies between two segments within ``near_m`` of each other is cut out."""
    kept = list(points)
    first = 0
    while first < len(kept) - 3:
        for later in range(len(kept) - 2, first + 1, -1):
            meeting = _meeting(kept[first], kept[first + 1], kept[later], kept[later + 1], near_m)
            if meeting is not None:
                kept[first + 1 : later + 1] = [meeting]
                break
        first += 1
    return kept


def _from_segment_m(point: Point, start: Point, end: Point) -> float:
    """Metres from a point to a segment."""
    return math.dist(point, _on_segment(point, start, end))


def _on_segment(point: Point, start: Point, end: Point) -> Point:
    """The point of a segment that is nearest to a point."""
    north, east = end[0] - start[0], end[1] - start[1]
    length = north * north + east * east
    share = 0.0
    if length > 0.0:
        share = ((point[0] - start[0]) * north + (point[1] - start[1]) * east) / length
        share = min(max(share, 0.0), 1.0)
    return start[0] + share * north, start[1] + share * east


def _meeting(a: Point, b: Point, c: Point, d: Point, near_m: float) -> Point | None:
    """Midpoint of the shortest connection of two segments if they are near each other; else None."""
    crossing = _crossing(a, b, c, d)
    if crossing is not None:
        return crossing
    pairs = [(p, _on_segment(p, c, d)) for p in (a, b)] + [(p, _on_segment(p, a, b)) for p in (c, d)]
    one, other = min(pairs, key=lambda pair: math.dist(*pair))
    if math.dist(one, other) > near_m:
        return None
    return (one[0] + other[0]) / 2.0, (one[1] + other[1]) / 2.0


def _crossing(a: Point, b: Point, c: Point, d: Point) -> Point | None:
    """Where two segments cross; None if they do not."""
    ab, cd, ac = (b[0] - a[0], b[1] - a[1]), (d[0] - c[0], d[1] - c[1]), (c[0] - a[0], c[1] - a[1])
    across = ab[0] * cd[1] - ab[1] * cd[0]
    if across == 0.0:
        return None
    share = (ac[0] * cd[1] - ac[1] * cd[0]) / across
    other = (ac[0] * ab[1] - ac[1] * ab[0]) / across
    if 0.0 <= share <= 1.0 and 0.0 <= other <= 1.0:
        return a[0] + share * ab[0], a[1] + share * ab[1]
    return None
