"""From the navigator's path to one guided setpoint and a speed.

The autopilot brakes for every guided point, so the point is rolled to the farthest place of the route that can be reached
straight and clear. It never lies beyond the ground seen free plus the stopping distance. Where the next piece of
the route has not been seen, the rover turns to look before it drives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.commands import GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint
from companion.frames import NedPoint, Pose, wrap_pi_rad
from companion.grid import Cell, Grid
from companion.mapping import EvidenceMap, Unseen, clearance_m, look_along, unseen_beside
from companion.planning.problem import Path
from companion.settings import GuidanceSettings

Points = NDArray[np.float64]
"""Shape (n, 2): columns north_m and east_m in the local frame."""

STEP_M = 0.25
STOP = GuidedVelocity(0.0, 0.0)
ROLL_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Directions, as shares of a turn, that are looked along before a rolling rover begins to turn."""


class Motion(StrEnum):
    """What the setpoint is for."""

    DRIVE = "drive"
    LOOK = "look"
    BRAKE = "brake"
    BLOCKED = "blocked"


@dataclass(frozen=True, eq=False, slots=True)
class Route:
    """The line to drive, in points ``STEP_M`` apart, and how far along it the rover has come."""

    points: Points
    progress: int = 0
    speeds_m_s: NDArray[np.float64] | None = None
    """The planned speed at each of the points, if the planner chooses speeds."""

    @property
    def end(self) -> NedPoint:
        """The last point."""
        return self.point(-1)

    def point(self, index: int) -> NedPoint:
        """One of the points."""
        return NedPoint(float(self.points[index, 0]), float(self.points[index, 1]))

    def point_ahead(self, distance_m: float) -> NedPoint:
        """The point so far on from the rover, along the route; at most its end."""
        return self.point(min(self.progress + round(distance_m / STEP_M), len(self.points) - 1))

    @property
    def planned_m_s(self) -> float:
        """The planned speed where the rover is now; infinite when none was planned."""
        return math.inf if self.speeds_m_s is None else float(self.speeds_m_s[self.progress])

    @property
    def left_m(self) -> float:
        """Length of the route that is left, in metres."""
        return (len(self.points) - 1 - self.progress) * STEP_M


@dataclass(frozen=True, slots=True)
class Guide:
    """What to tell the autopilot now."""

    motion: Motion
    setpoint: Setpoint
    speed_m_s: float


STANDSTILL = Guide(Motion.BLOCKED, STOP, 0.0)


@dataclass(frozen=True, slots=True)
class RoverLimits:
    """The rover as guidance sees it."""

    radius_m: float
    cruise_speed_m_s: float
    sight_m: float
    """Valid range of the sensor."""
    narrow_sight: bool = False
    """Whether it is single thin beams."""
    turning_radius_m: float = 0.0
    """The tightest arc it can drive; 0: it turns on the spot."""


def route_along_cells(grid: Grid, cells: tuple[Cell, ...], start: NedPoint, end: NedPoint | None) -> Route:
    """The route from ``start`` (in the first field) through the middles of the others; ``end`` replaces the last one."""
    corners = [start, *(grid.centre_of(cell) for cell in cells[1:])]
    if end is not None:
        corners[-1 if len(corners) > 1 else 1 :] = [end]
    return Route(_densified(np.array([(p.north_m, p.east_m) for p in corners])))


def route_along_curve(grid: Grid, curve: NDArray[np.float64], start: NedPoint, end: NedPoint | None) -> Route:
    """The route along a planner's smooth curve (x, y in fields); ``start`` and ``end`` replace its ends."""
    north = grid.south_west.north_m + (curve[:, 1] + 0.5) * grid.resolution_m
    east = grid.south_west.east_m + (curve[:, 0] + 0.5) * grid.resolution_m
    points = np.column_stack((north, east))
    points[0] = (start.north_m, start.east_m)
    if end is not None:
        points[-1] = (end.north_m, end.east_m)
    return Route(_densified(points))


def route_is_clear(route: Route, evidence: EvidenceMap, half_width_m: float) -> bool:
    """Whether a rover of this half width can drive the whole route on the map as known."""
    stride = max(1, round(evidence.base.resolution_m / STEP_M))
    stops = [*range(0, len(route.points) - 1, stride), len(route.points) - 1]
    for i, j in pairwise(stops):
        here, there = route.point(i), route.point(j)
        if look_along(evidence, here, there, half_width_m).clear_m < here.distance_m(there) - 1e-6:
            return False
    return True


def advanced(route: Route, pose: Pose, window_m: float = 4.0) -> Route:
    """The route with its progress moved to the point nearest to the rover, never back and not more than the window ahead."""
    stop = min(len(route.points), route.progress + int(window_m / STEP_M) + 1)
    ahead = route.points[route.progress : stop]
    nearest = int(np.argmin((ahead[:, 0] - pose.north_m) ** 2 + (ahead[:, 1] - pose.east_m) ** 2))
    return Route(route.points, route.progress + nearest, route.speeds_m_s)


def with_planned_speeds(route: Route, path: Path, resolution_m: float) -> Route:
    """The route with the speeds of the path it follows, each at its share of the whole length; unchanged without any."""
    if path.curve is None or path.speeds_fields_s is None or len(path.speeds_fields_s) == 0:
        return route
    ends = np.cumsum(np.hypot(*np.diff(path.curve, axis=0).T))
    shares = np.linspace(0.0, 1.0, len(route.points))
    pieces = np.searchsorted(ends / max(float(ends[-1]), 1e-9), shares, side="right")
    speeds = path.speeds_fields_s[np.minimum(pieces, len(path.speeds_fields_s) - 1)] * resolution_m
    return Route(route.points, route.progress, np.asarray(speeds, np.float64))


def guide(
    route: Route,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    *,
    looking_rad: float | None = None,
    braking: bool = False,
) -> Guide:
    """The setpoint and speed for this moment. ``BLOCKED`` means that not even the next piece of the route is clear.

    ``looking_rad``: the heading of the last answer if that was LOOK. It is kept until reached, and a longer clear reach is wanted
    before driving off, so that a narrow sensor looks to both sides once, not at every step.
    """
    needed_m = braking_distance_m(speed_m_s, settings)
    if _would_touch(pose, speed_m_s, needed_m, evidence, rover, settings):
        return Guide(Motion.BRAKE, STOP, 0.0)
    target, reach_m, room_m = _farthest_clear(route, pose, speed_m_s, evidence, rover, settings)
    distance_m = pose.point.distance_m(route.end)
    at_end = len(route.points) - 1 - route.progress <= int(1.0 / STEP_M)
    rolling = speed_m_s > settings.roll_out_m_s
    if rolling and reach_m < min(needed_m + (settings.brake_on_m if braking else 0.0), distance_m - 0.1):
        return Guide(Motion.BRAKE, STOP, 0.0)
    wanted_m = settings.least_reach_m if looking_rad is None else settings.reach_after_look_m
    if reach_m < min(wanted_m, distance_m - 0.1) and not (at_end and reach_m > 0.0):
        if looking_rad is not None and not _is_turned_to(looking_rad, pose, settings):
            return turn_to(looking_rad, speed_m_s, settings)
        look = _look_or_blocked(route, pose, speed_m_s, evidence, rover, settings)
        if look.motion is not Motion.DRIVE or reach_m < settings.least_reach_m:
            return look
    bearing = pose.point.bearing_rad(target)
    error = abs(wrap_pi_rad(bearing - pose.heading_rad))
    beside_m = clearance_m(evidence, pose.point, settings.slow_within_m + rover.radius_m) - rover.radius_m
    close = beside_m < settings.slow_within_m
    if error > _turn_first_rad(close, looking_rad is not None, settings) and pose.point.distance_m(target) > 0.5:
        close = close or _would_touch_turning(pose, speed_m_s, bearing, evidence, rover, settings)
        return turn_to(bearing, speed_m_s if close else 0.0, settings)
    limit_m_s = speed_limit_m_s(min(beside_m, room_m), error, rover, settings)
    limit_m_s = min(limit_m_s, _limit_by_heading(pose, evidence, rover, settings))
    return Guide(Motion.DRIVE, GuidedPosition(target), limit_m_s)


def _turn_first_rad(close: bool, turning: bool, settings: GuidanceSettings) -> float:
    """The bearing error from which the rover turns on the spot instead of driving an arc, which it must not near something.

    A position far to the side would make the autopilot pivot too, but with its old target still winding up behind the scenes; so
    a heading is given first, until the rest is small.
    """
    if turning:
        return math.radians(settings.turn_until_close_deg if close else settings.turn_until_deg)
    return math.radians(settings.turn_first_close_deg if close else settings.turn_first_deg)


def _would_touch(
    pose: Pose, speed_m_s: float, needed_m: float, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings
) -> bool:
    """Whether the rover, going straight on, would touch something before it could stop."""
    if speed_m_s <= settings.roll_out_m_s:
        return False
    ahead = pose.point.moved(pose.heading_rad, needed_m)
    return look_along(evidence, pose.point, ahead, rover.radius_m + 0.05).clear_m < needed_m - 1e-6


def _would_touch_turning(
    pose: Pose,
    speed_m_s: float,
    bearing_rad: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
) -> bool:
    """Whether the rover, turning to the bearing while it still rolls, could touch something: it comes to stand in between."""
    roll_m = braking_distance_m(speed_m_s, settings)
    turn_rad = wrap_pi_rad(bearing_rad - pose.heading_rad)
    for share in ROLL_SHARES:
        there = pose.point.moved(pose.heading_rad + share * turn_rad, roll_m)
        if look_along(evidence, pose.point, there, rover.radius_m + 0.05).clear_m < roll_m - 1e-6:
            return True
    return False


def _is_turned_to(bearing_rad: float, pose: Pose, settings: GuidanceSettings) -> bool:
    return abs(wrap_pi_rad(bearing_rad - pose.heading_rad)) <= math.radians(settings.turned_deg)


def turn_to(bearing_rad: float, speed_m_s: float, settings: GuidanceSettings) -> Guide:
    """Turn on the spot; a rover that still rolls brakes first, lest it drives an arc."""
    if speed_m_s > settings.roll_out_m_s:
        return Guide(Motion.BRAKE, STOP, 0.0)
    return Guide(Motion.LOOK, GuidedHeading(bearing_rad), settings.min_speed_m_s)


def braking_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from the stop command to standing still."""
    return speed_m_s * settings.brake_delay_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def stopping_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from something coming into sight to standing still."""
    return speed_m_s * settings.latency_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def farthest_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """How far away a guided target may lie, straight."""
    return settings.horizon_m + stopping_distance_m(speed_m_s, settings)


def fastest_within_m(distance_m: float, settings: GuidanceSettings) -> float:
    """The speed from which the rover can stop within a distance: the inverse of ``stopping_distance_m``."""
    a, t = settings.deceleration_m_s2, settings.latency_s
    return a * (math.sqrt(t * t + 2.0 * max(distance_m, 0.0) / a) - t)


def _farthest_clear(
    route: Route, pose: Pose, speed_m_s: float, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings
) -> tuple[NedPoint, float, float]:
    """The farthest route point in clear sight, how far away it is, and the room kept beside the rover on the way there.

    Wide clearance where there is room; less only where that leads farther. A wall that thin beams have seen once stays in the map
    where the position then was, and the position wanders: from such walls more distance is kept.
    """
    best = (pose.point, 0.0, 0.0)
    for extra_m, enough_m in settings.clearances:
        if rover.narrow_sight and extra_m < settings.narrow_clearance_m:
            break
        target, reach_m = _farthest_with(route, pose, speed_m_s, evidence, rover, extra_m, settings)
        if reach_m > best[1] + 0.5 or best[1] == 0.0:
            best = (target, reach_m, extra_m)
        if best[1] >= min(enough_m, pose.point.distance_m(route.end) - 0.1):
            break
    return best


def _farthest_with(
    route: Route,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    extra_m: float,
    settings: GuidanceSettings,
) -> tuple[NedPoint, float]:
    beyond_m = speed_m_s**2 / (2.0 * settings.deceleration_m_s2)
    flanks_m = settings.flanks_seen_m + stopping_distance_m(speed_m_s, settings)
    last = min(len(route.points) - 1, route.progress + int(settings.horizon_m / STEP_M))
    for index in range(last, route.progress, -2):
        point = route.point(index)
        distance_m = pose.point.distance_m(point)
        if not 0.05 <= distance_m <= farthest_m(speed_m_s, settings):
            continue
        line = look_along(evidence, pose.point, point, rover.radius_m + extra_m)
        if line.clear_m < distance_m - 0.05 or line.seen_m + beyond_m < distance_m - 0.05:
            continue
        unseen = _unseen_flank(pose, point, evidence, rover)
        if unseen is None or unseen.along_m >= min(distance_m, flanks_m):
            return point, distance_m
    return pose.point, 0.0


def _unseen_flank(pose: Pose, point: NedPoint, evidence: EvidenceMap, rover: RoverLimits) -> Unseen | None:
    """Where the rover's flanks would enter unseen ground on the way to a point."""
    return unseen_beside(evidence, pose.point, point, rover.radius_m + 0.05, rover.radius_m + 0.2)


def _look_or_blocked(
    route: Route,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
) -> Guide:
    """The next piece is not clear, or has not been seen: turn to it; when turned and still so, it is blocked."""
    ahead = route.point_ahead(settings.look_ahead_m)
    line = look_along(evidence, pose.point, ahead, rover.radius_m)
    distance_m = pose.point.distance_m(ahead)
    unseen = _unseen_flank(pose, route.point_ahead(settings.reach_after_look_m), evidence, rover)
    view = ahead if line.seen_m < distance_m - 0.05 or unseen is None else unseen.place
    bearing = pose.point.bearing_rad(view)
    if not _is_turned_to(bearing, pose, settings):
        return turn_to(bearing, speed_m_s, settings)
    if line.clear_m >= distance_m - 0.05:
        # Looked at, and nothing there, but between the beams: creep.
        creep_m = min(line.seen_m, distance_m) + braking_distance_m(settings.min_speed_m_s, settings)
        bearing = pose.point.bearing_rad(ahead)
        return Guide(Motion.DRIVE, GuidedPosition(pose.point.moved(bearing, creep_m)), settings.min_speed_m_s)
    return Guide(Motion.BLOCKED, STOP, 0.0)


def speed_limit_m_s(beside_m: float, bearing_error_rad: float, rover: RoverLimits, settings: GuidanceSettings) -> float:
    """Cruise speed; less where the sensor sees too short, something is close beside, or the rover is still turning."""
    sight = fastest_within_m(rover.sight_m - rover.radius_m - settings.clearance_m, settings)
    share = min(max(beside_m / settings.slow_within_m, 0.0), 1.0)
    beside = settings.min_speed_m_s + share * max(rover.cruise_speed_m_s - settings.min_speed_m_s, 0.0)
    turning = rover.cruise_speed_m_s if bearing_error_rad < math.radians(20.0) else 2.0 * settings.min_speed_m_s
    narrow = settings.narrow_speed_m_s if rover.narrow_sight else rover.cruise_speed_m_s
    return min(max(min(sight, beside, turning, narrow), settings.min_speed_m_s), rover.cruise_speed_m_s)


def _limit_by_heading(pose: Pose, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings) -> float:
    """The speed from which the rover can stop before its flanks enter unseen ground, should it go on as it points.

    A target a few degrees aside is reached on an arc, and what stands beside that arc was not looked at on the way to the target.
    """
    ahead = pose.point.moved(pose.heading_rad, stopping_distance_m(rover.cruise_speed_m_s, settings))
    unseen = _unseen_flank(pose, ahead, evidence, rover)
    if unseen is None:
        return rover.cruise_speed_m_s
    return min(max(fastest_within_m(unseen.along_m, settings), settings.min_speed_m_s), rover.cruise_speed_m_s)


def _densified(corners: Points) -> Points:
    """Points ``STEP_M`` apart (at most) along the line through the corners, ends included."""
    if len(corners) == 1:
        return corners
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    wanted = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / STEP_M) + 1))
    return np.column_stack((np.interp(wanted, along, corners[:, 0]), np.interp(wanted, along, corners[:, 1])))
