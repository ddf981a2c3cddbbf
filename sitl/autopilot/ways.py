"""Driving to places in AUTO, RTL and SMART_RTL, and the path that SMART_RTL drives back."""

from __future__ import annotations

import math

from sitl.autopilot.area import Place, distance_m, nearest, outside
from sitl.autopilot.control import LEG, STOP
from sitl.autopilot.guided import begin_guided
from sitl.autopilot.legs import begin_leg
from sitl.autopilot.plan import WayBack
from sitl.autopilot.vehicle import INFO, Mode, Vehicle
from sitl.world import geodesy

CIRCLE_FENCE, POLYGON_FENCE = 2, 4
"""Bits of FENCE_TYPE: the circle round home, and what was uploaded."""
SAVE_EVERY_US = 300_000
SIMPLIFY_AT = 50
"""New points on the path after which it is simplified."""
SLOWEST_M_S = 0.05


def begin_driving(vehicle: Vehicle, speed_m_s: float = 0.0) -> None:
    """Start anew with the limits of the parameters; a speed of 0 is WP_SPEED."""
    begin_guided(vehicle.control[0], vehicle.tuning[0])
    if speed_m_s > 0.0:
        vehicle.control["base_speed"] = vehicle.control["speed_max"] = max(speed_m_s, SLOWEST_M_S)


def drive_to(vehicle: Vehicle, place: Place, following: Place | None = None) -> None:
    """Drive to a place; if it is known where to go from there, without stopping in between."""
    vehicle.destination = place
    north_m, east_m = geodesy.offset_m(vehicle.origin, place)
    after = (0.0, 0.0) if following is None else geodesy.offset_m(vehicle.origin, following)
    records = vehicle.control[0], vehicle.tuning[0], vehicle.estimate[0]
    begin_leg(*records, north_m, east_m, *after, following is not None)


def stand(vehicle: Vehicle) -> None:
    """Brake and stay."""
    vehicle.control["task"] = STOP


def arrived(vehicle: Vehicle) -> bool:
    """Whether the place that is driven to has been reached."""
    control = vehicle.control[0]
    return int(control["task"]) == LEG and bool(control["reached"])


def allowed(vehicle: Vehicle, place: Place) -> bool:
    """Whether no enabled fence forbids a place."""
    kinds = vehicle.plan.fence.enabled
    if kinds & CIRCLE_FENCE and distance_m(vehicle.home, place) > vehicle.parameters["FENCE_RADIUS"]:
        return False
    options = int(vehicle.parameters["FENCE_OPTIONS"])
    return not (kinds & POLYGON_FENCE and outside(vehicle.plan.storage.fence, place, options))


def way_home(vehicle: Vehicle) -> Place:
    """Where RTL goes: home, or the nearest rally point that is allowed and not too far."""
    here = vehicle.place()
    points = [item.place for item in vehicle.plan.storage.rally if allowed(vehicle, item.place)]
    point = nearest(here, points)
    if point is None:
        return vehicle.home
    limit_m = vehicle.parameters["RALLY_LIMIT_KM"] * 1000.0
    if 0.0 < limit_m < distance_m(here, point):
        return vehicle.home
    if vehicle.parameters["RALLY_INCL_HOME"] and distance_m(here, vehicle.home) <= distance_m(here, point):
        return vehicle.home
    return point


def begin_return(vehicle: Vehicle) -> None:
    """RTL, as a mode or as an item of a mission."""
    begin_driving(vehicle, vehicle.parameters["RTL_SPEED"])
    vehicle.plan.told_arrival = False
    drive_to(vehicle, way_home(vehicle))
    vehicle.control["halts"] = 1


def run_return(vehicle: Vehicle) -> None:
    """Tell once of having arrived."""
    if arrived(vehicle) and not vehicle.plan.told_arrival:
        vehicle.plan.told_arrival = True
        vehicle.say(INFO, "Reached destination")


def begin_way_back(vehicle: Vehicle) -> None:
    """SMART_RTL: brake, and tidy the path up."""
    begin_driving(vehicle, vehicle.parameters["RTL_SPEED"])
    way = vehicle.plan.way_back
    way.points = without_loops(simplified(way.points, _tolerance_m(vehicle)), _tolerance_m(vehicle))
    way.simplified = len(way.points)
    way.following, way.load, way.done = True, True, False
    vehicle.control["task"] = STOP


def run_way_back(vehicle: Vehicle) -> None:
    """SMART_RTL: from point to point back to where it was armed."""
    way = vehicle.plan.way_back
    if way.done:
        return
    if arrived(vehicle):
        way.load = True
    if not way.load:
        return
    way.load = False
    if not way.points:
        way.done = True
        stand(vehicle)
        vehicle.say(INFO, "Reached destination")
        return
    north_m, east_m = way.points.pop()
    way.simplified = min(way.simplified, len(way.points))
    after = geodesy.moved(vehicle.origin, *way.points[-1]) if way.points else None
    drive_to(vehicle, geodesy.moved(vehicle.origin, north_m, east_m), after)


def remember_start(vehicle: Vehicle) -> None:
    """On arming: the path begins here."""
    if vehicle.parameters["SRTL_POINTS"] <= 0.0 or vehicle.parameters["SRTL_ACCURACY"] <= 0.0:
        return
    way = vehicle.plan.way_back
    way.points = [vehicle.position_m()] if vehicle.has_position else []
    way.active = way.home_saved = vehicle.has_position
    way.simplified = 0
    way.saved_s = vehicle.time_s


def remember_path(vehicle: Vehicle) -> None:
    """Three times a second: one more point, SRTL_ACCURACY away from the last; not on the way back."""
    way = vehicle.plan.way_back
    if not way.home_saved and vehicle.has_position:
        remember_start(vehicle)
    if not way.active or vehicle.mode == Mode.SMART_RTL or not vehicle.has_position:
        return
    here, last = vehicle.position_m(), way.points[-1] if way.points else None
    if last is not None and math.dist(here, last) < vehicle.parameters["SRTL_ACCURACY"]:
        way.saved_s = vehicle.time_s
        return
    most = int(min(vehicle.parameters["SRTL_POINTS"], 500.0))
    if len(way.points) - way.simplified >= SIMPLIFY_AT or len(way.points) >= most - 10:
        way.points = simplified(way.points, _tolerance_m(vehicle))
        if len(way.points) >= most - 10:
            way.points = without_loops(way.points, _tolerance_m(vehicle))
        way.simplified = len(way.points)
    if len(way.points) < most:
        way.points.append(here)
        way.saved_s = vehicle.time_s
    elif vehicle.time_s - way.saved_s > 15.0:
        _give_up(vehicle, way)


def _give_up(vehicle: Vehicle, way: WayBack) -> None:
    way.active = False
    vehicle.say(4, "SmartRTL deactivated: buffer full")


def _tolerance_m(vehicle: Vehicle) -> float:
    """How far the tidied path may be from the recorded one."""
    return float(vehicle.parameters["SRTL_ACCURACY"]) * 0.5


Point = tuple[float, float]


def simplified(points: list[Point], tolerance_m: float) -> list[Point]:
    """The path with fewer points, nowhere farther than the tolerance from the old one (Ramer, Douglas, Peucker)."""
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
    """The path without the loops between legs that come near to each other; what is left may be driven both ways."""
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
    """Metres from a point to a straight piece."""
    return math.dist(point, _on_segment(point, start, end))


def _on_segment(point: Point, start: Point, end: Point) -> Point:
    """The place of a straight piece that is nearest to a point."""
    north, east = end[0] - start[0], end[1] - start[1]
    length = north * north + east * east
    share = 0.0
    if length > 0.0:
        share = ((point[0] - start[0]) * north + (point[1] - start[1]) * east) / length
        share = min(max(share, 0.0), 1.0)
    return start[0] + share * north, start[1] + share * east


def _meeting(a: Point, b: Point, c: Point, d: Point, near_m: float) -> Point | None:
    """Half-way between two straight pieces where they are nearest, if they are near; None otherwise."""
    crossing = _crossing(a, b, c, d)
    if crossing is not None:
        return crossing
    pairs = [(p, _on_segment(p, c, d)) for p in (a, b)] + [(p, _on_segment(p, a, b)) for p in (c, d)]
    one, other = min(pairs, key=lambda pair: math.dist(*pair))
    if math.dist(one, other) > near_m:
        return None
    return (one[0] + other[0]) / 2.0, (one[1] + other[1]) / 2.0


def _crossing(a: Point, b: Point, c: Point, d: Point) -> Point | None:
    """Where two straight pieces cross."""
    ab, cd, ac = (b[0] - a[0], b[1] - a[1]), (d[0] - c[0], d[1] - c[1]), (c[0] - a[0], c[1] - a[1])
    across = ab[0] * cd[1] - ab[1] * cd[0]
    if across == 0.0:
        return None
    share = (ac[0] * cd[1] - ac[1] * cd[0]) / across
    other = (ac[0] * ab[1] - ac[1] * ab[0]) / across
    if 0.0 <= share <= 1.0 and 0.0 <= other <= 1.0:
        return a[0] + share * ab[0], a[1] + share * ab[1]
    return None
