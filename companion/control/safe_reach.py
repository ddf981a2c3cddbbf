"""How far the rover may be sent. What it is told may be the last that it is ever told, and it will follow that to its end.

So a place to drive to is one where it can be left alone: it comes to stand on ground that has been seen free, and nothing stands beside the
way there. ``companion/control/setpoint_check.py`` asks the same once more of whatever is really sent.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from companion.control.braking import blind_distance_m, farthest_m, fastest_blind_m_s, overshoot_m
from companion.control.reference_path import STEP_M, Route
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.arc_kernels import BLOCKED, UNSEEN, arc_clear, kept_room
from companion.mapping.evidence_map import EvidenceMap, Unseen, ground_of, in_cells, look_along, unseen_beside
from companion.settings import GuidanceSettings

BACK_LEAST_M_S = 0.2
"""Where there is less room behind than this needs, it does not back out at all."""
ROLLED_M = 0.05
"""So fine are targets chosen along the route, and so far may their front lie beyond seen ground: the steps in which it is looked along."""


def farthest_clear(
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
    def may(point: NedPoint, distance_m: float) -> bool:
        return may_be_last(pose, point, distance_m, evidence, rover, extra_m, settings)

    farthest = farthest_m(speed_m_s, settings)
    last = min(len(route.points) - 1, route.progress + int(settings.horizon_m / STEP_M))
    for index in range(last, route.progress, -2):  # in double steps, for speed
        point = route.point(index)
        distance_m = pose.point.distance_m(point)
        if 0.05 <= distance_m <= farthest and may(point, distance_m):
            return rolled_on(route, index, last, pose, farthest, may)
    return pose.point, 0.0


def rolled_on(
    route: Route, index: int, last: int, pose: Pose, farthest: float, may: Callable[[NedPoint, float], bool]
) -> tuple[NedPoint, float]:
    """From a point that may be the target towards the next ones that may not, as near as ``ROLLED_M``; ``farthest``: metres.

    The autopilot drives the faster the farther its target lies, so no decimetre is given away.
    """
    point = route.point(index)
    distance_m = pose.point.distance_m(point)
    for further in (route.point(i) for i in (index + 1, index + 2) if i <= last):
        bearing, left_m = point.bearing_rad(further), point.distance_m(further)
        pieces = max(1, math.ceil(left_m / ROLLED_M - 1e-6))
        for _ in range(pieces):
            nearer = point.moved(bearing, left_m / pieces)
            nearer_m = pose.point.distance_m(nearer)
            if not distance_m < nearer_m <= farthest or not may(nearer, nearer_m):
                return point, distance_m
            point, distance_m = nearer, nearer_m
    return point, distance_m


def may_be_last(
    pose: Pose,
    point: NedPoint,
    distance_m: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    extra_m: float,
    settings: GuidanceSettings,
) -> bool:
    """Whether the rover could be left alone with this target: it comes to stand there, or a little farther, on ground seen free.

    Its front must come to lie on seen ground, too, and so must its flanks all the way.
    """
    bearing = pose.point.bearing_rad(point)
    over_m = overshoot_m(distance_m, settings)
    line = look_along(evidence, pose.point, point, rover.radius_m + extra_m)
    if line.clear_m < distance_m - 0.05 or line.seen_m < distance_m - 0.05:
        return False
    stands = point.moved(bearing, _inside_m(evidence, point, bearing, over_m))
    stands_m = pose.point.distance_m(stands)
    if look_along(evidence, pose.point, stands, rover.radius_m).clear_m < stands_m - 0.05:
        return False
    front = stands.moved(bearing, _inside_m(evidence, stands, bearing, rover.radius_m))
    if look_along(evidence, stands, front, 0.0).seen_m < stands.distance_m(front) - ROLLED_M:
        return False
    return unseen_flank(pose, stands, evidence, rover) is None


def _inside_m(evidence: EvidenceMap, point: NedPoint, bearing_rad: float, distance_m: float) -> float:
    """So much of the distance from a place of the map as does not leave it: what lies beyond, nobody needs to have seen."""
    grid = evidence.base
    corner = grid.south_west
    for from_m, size_m, step in (
        (point.north_m - corner.north_m, grid.height * grid.resolution_m, math.cos(bearing_rad)),
        (point.east_m - corner.east_m, grid.width * grid.resolution_m, math.sin(bearing_rad)),
    ):
        room_m = size_m - from_m if step > 0.0 else from_m
        if abs(step) * distance_m > room_m - 0.01:
            distance_m = max(room_m - 0.01, 0.0) / abs(step)
    return distance_m


def unseen_flank(pose: Pose, point: NedPoint, evidence: EvidenceMap, rover: RoverLimits) -> Unseen | None:
    """Where the rover's flanks would enter unseen ground on the way to a point."""
    return unseen_beside(evidence, pose.point, point, rover.radius_m + 0.05, rover.radius_m + 0.2)


def arc_is_free(pose: Pose, target: NedPoint, evidence: EvidenceMap, rover: RoverLimits) -> bool:
    """Whether the arc on which the rover comes to the target, beginning as it points now, is clear and has been seen.

    To a target behind there is none that it would drive.
    """
    ground = ground_of(evidence, pose)
    scale = 1.0 / evidence.evidence_m
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0].tolist()
    distance = pose.point.distance_m(target) * scale
    aside_rad = wrap_pi_rad(pose.point.bearing_rad(target) - pose.heading_rad)
    if abs(aside_rad) > 0.5 * math.pi:
        return False
    curvature = 2.0 * math.sin(aside_rad) / distance
    length = distance / float(np.sinc(aside_rad / math.pi))
    room = kept_room(ground, x, y, (rover.radius_m + 0.05) * scale, (rover.radius_m - 0.05) * scale)
    return bool(arc_clear(ground, x, y, pose.heading_rad, curvature, room, length, UNSEEN) >= length - 1e-6)


def backing_speed_m_s(pose: Pose, evidence: EvidenceMap, radius_m: float, settings: GuidanceSettings) -> float:
    """How fast a rover may be told to back off: it goes on until the velocity is forgotten, should nothing more be said.

    Closed fields count from the first one on that it does not stand in: a line looked along passes over those that begin close by.
    """
    fastest_m_s, scale, ground = settings.back_out_speed_m_s, 1.0 / evidence.evidence_m, ground_of(evidence, pose)
    tail_rad, reach_m = pose.heading_rad + math.pi, blind_distance_m(fastest_m_s, settings)
    line = look_along(evidence, pose.point, pose.point.moved(tail_rad, reach_m), radius_m + settings.clearance_m)
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0].tolist()
    room = kept_room(ground, x, y, radius_m * scale, 0.0)
    open_m = arc_clear(ground, x, y, tail_rad, 0.0, room, reach_m * scale, BLOCKED) / scale
    return min(fastest_m_s, fastest_blind_m_s(min(line.clear_m, line.seen_m, open_m), settings))
