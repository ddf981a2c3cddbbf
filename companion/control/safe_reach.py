"""Safe reach: how far the rover may be sent, so that it can be left alone if the link fails after this message.

A setpoint may be the last that the autopilot receives, and it is followed to its end. So a place to drive to is one
where the rover comes to stand on ground that has been seen free, with nothing beside the way there.
``setpoint_check`` asks the same once more of whatever is really sent.

Nouns: safe reach.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.control.braking import blind_distance_m, farthest_m, fastest_blind_m_s, overshoot_m
from companion.control.local_view import LocalView
from companion.control.reference_path import STEP_M, ReferencePath
from companion.core.frames import NedPoint, wrap_pi_rad
from companion.mapping.map_queries import ArcQueries, Unseen, Until, look_along, unseen_beside, within_map_m

BACK_LEAST_M_S = 0.2
"""The rover does not back out at all where there is only room to do so slower than this."""
ROLLED_M = 0.05
"""Targets along the path are chosen in steps of this; the rover's front may lie beyond seen ground by as much."""


@dataclass(frozen=True, slots=True)
class Reach:
    """A place to drive to, straight: its distance, and the room that is kept beside the rover on the way there."""

    target: NedPoint
    distance_m: float
    room_m: float


def farthest_clear(path: ReferencePath, view: LocalView) -> Reach:
    """The farthest place of the path in clear sight.

    Wide room beside the rover is tried first; less room counts only if it leads farther. With thin beams more room is
    kept: they map a wall in the wrong place when the position is wrong at that moment, and it stays there.
    """
    settings, here = view.settings.guidance, view.pose.point
    best = Reach(here, 0.0, 0.0)
    for extra_m, enough_m in settings.clearances:
        if view.rover.narrow_sight and extra_m < settings.narrow_clearance_m:
            break
        found = _farthest_with(path, view, extra_m)
        if found.distance_m > best.distance_m + 0.5 or best.distance_m == 0.0:
            best = found
        if best.distance_m >= min(enough_m, here.distance_m(path.end) - 0.1):
            break
    return best


def _farthest_with(path: ReferencePath, view: LocalView, room_m: float) -> Reach:
    settings, here = view.settings.guidance, view.pose.point
    limit_m = farthest_m(view.speed_m_s, settings)
    last = min(len(path.points) - 1, path.progress + int(settings.horizon_m / STEP_M))
    for index in range(last, path.progress, -2):  # in double steps, for speed
        target = path.point(index)
        reach = Reach(target, here.distance_m(target), room_m)
        if 0.05 <= reach.distance_m <= limit_m and may_be_last(view, reach):
            return _moved_on(reach, [path.point(i) for i in (index + 1, index + 2) if i <= last], view, limit_m)
    return Reach(here, 0.0, room_m)


def _moved_on(reach: Reach, further: list[NedPoint], view: LocalView, limit_m: float) -> Reach:
    """The target moved on towards the next points of the path, which are too far, in steps of ``ROLLED_M``.

    The farther the target, the faster the autopilot drives, so no decimetre is given away.
    """
    for point in further:
        bearing, left_m = reach.target.bearing_rad(point), reach.target.distance_m(point)
        pieces = max(1, math.ceil(left_m / ROLLED_M - 1e-6))
        for _ in range(pieces):
            target = reach.target.moved(bearing, left_m / pieces)
            nearer = Reach(target, view.pose.point.distance_m(target), reach.room_m)
            if not reach.distance_m < nearer.distance_m <= limit_m or not may_be_last(view, nearer):
                return reach
            reach = nearer
    return reach


def may_be_last(view: LocalView, reach: Reach) -> bool:
    """Whether the rover could be left alone with this target: it stops there, or a little farther, on ground seen free.

    Its front must come to lie on seen ground, too, and so must its flanks all the way.
    """
    evidence, here, radius_m = view.evidence, view.pose.point, view.rover.radius_m
    bearing = here.bearing_rad(reach.target)
    line = look_along(evidence, here, reach.target, radius_m + reach.room_m)
    if line.clear_m < reach.distance_m - 0.05 or line.seen_m < reach.distance_m - 0.05:
        return False
    over_m = overshoot_m(reach.distance_m, view.settings.guidance)
    stands = reach.target.moved(bearing, within_map_m(evidence, reach.target, bearing, over_m))
    if unseen_flank(view, stands) is not None:  # asked early: thin beams fail here most often
        return False
    if look_along(evidence, here, stands, radius_m).clear_m < here.distance_m(stands) - 0.05:
        return False
    front = stands.moved(bearing, within_map_m(evidence, stands, bearing, radius_m))
    return look_along(evidence, stands, front, 0.0).seen_m >= stands.distance_m(front) - ROLLED_M


def unseen_flank(view: LocalView, point: NedPoint) -> Unseen | None:
    """Where the rover's flanks would enter unseen ground on the way to a point."""
    radius_m = view.rover.radius_m
    return unseen_beside(view.evidence, view.pose.point, point, radius_m + 0.05, radius_m + 0.2)


def arc_is_free(view: LocalView, target: NedPoint) -> bool:
    """Whether the arc on which the rover comes to the target, beginning as it points now, is clear and has been seen.

    False for a target behind the rover: it would not drive there on an arc.
    """
    pose, radius_m, arcs = view.pose, view.rover.radius_m, ArcQueries(view.evidence, view.pose)
    distance_m = pose.point.distance_m(target)
    aside_rad = wrap_pi_rad(pose.point.bearing_rad(target) - pose.heading_rad)
    if abs(aside_rad) > 0.5 * math.pi:
        return False
    curvature_per_m = 2.0 * math.sin(aside_rad) / distance_m
    length_m = distance_m / float(np.sinc(aside_rad / math.pi))
    room_m = arcs.kept_room_m(radius_m + 0.05, radius_m - 0.05)
    return arcs.arc_is_clear(pose.heading_rad, curvature_per_m, room_m, length_m, Until.UNSEEN)


def backing_speed_m_s(view: LocalView) -> float:
    """How fast the rover may be told to back off: without another message it goes on until the velocity is forgotten.

    Closed fields count from the first one on that it does not stand in; ``look_along`` passes over those that begin
    close by.
    """
    pose, radius_m, settings = view.pose, view.rover.radius_m, view.settings.guidance
    fastest_m_s, arcs = settings.back_out_speed_m_s, ArcQueries(view.evidence, pose)
    tail_rad, reach_m = pose.heading_rad + math.pi, blind_distance_m(fastest_m_s, settings)
    line = look_along(view.evidence, pose.point, pose.point.moved(tail_rad, reach_m), radius_m + settings.clearance_m)
    open_m = arcs.arc_clear_m(tail_rad, 0.0, arcs.kept_room_m(radius_m, 0.0), reach_m, Until.BLOCKED)
    return min(fastest_m_s, fastest_blind_m_s(min(line.clear_m, line.seen_m, open_m), settings))
