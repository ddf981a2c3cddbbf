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
from companion.mapping.map_queries import ArcQueries, Unseen, Until, ground_at, look_along, unseen_beside
from companion.mapping.reach_kernels import Stopping, first_to_stop_at, stops_in_a_row

BACK_LEAST_M_S = 0.2
"""The rover does not back out at all where there is only room to do so slower than this."""
ROLLED_M = 0.05
"""Targets along the path are chosen in steps of this; the rover's front may lie beyond seen ground by as much."""
UNSURE_M = 0.1
"""An obstacle far ahead may stand, and ground that was seen may end, so much nearer: position and range are noisy."""
FLANK_M, FLANK_NEAR_M = 0.05, 0.2
"""So far beside the rover the ground must have been seen, from so far before it on: no sensor sees nearer."""


@dataclass(frozen=True, slots=True)
class Reach:
    """A place to drive to, straight: its distance, and the room that is kept beside the rover on the way there."""

    target: NedPoint
    distance_m: float
    room_m: float


def farthest_clear(path: ReferencePath, view: LocalView) -> Reach:
    """The farthest place of the path in clear sight.

    With wide room where there is that much, with less only where that leads farther. From walls that thin beams
    have seen more distance is kept: such a wall stays in the map where the position was wrong at that moment.
    """
    settings, here = view.settings.guidance, view.pose.point
    best = Reach(here, 0.0, 0.0)
    search = _Search(path, view)
    for extra_m, enough_m in settings.clearances:
        if view.rover.narrow_sight and extra_m < settings.narrow_clearance_m:
            break
        found = search.farthest(extra_m)
        if found.distance_m > best.distance_m + 0.5 or best.distance_m == 0.0:
            best = found
        if best.distance_m >= min(enough_m, here.distance_m(path.end) - 0.1):
            break
    return best


class _Search:
    """Looks for the farthest target, among the points of a path, that may be the last the autopilot receives.

    The rover stops there, or a little farther, on ground seen free (``reach_kernels.may_stop_at``).
    """

    def __init__(self, path: ReferencePath, view: LocalView) -> None:
        settings, frame = view.settings.guidance, view.evidence.frame
        self._path, self._view = path, view
        self._last = min(len(path.points) - 1, path.progress + int(settings.horizon_m / STEP_M))
        self._limit_m = farthest_m(view.speed_m_s, settings, narrow=view.rover.narrow_sight)
        self._ground = ground_at(view.evidence, view.pose)
        self._start = frame.xy(view.pose.point)
        # From the farthest on, in double steps, for speed.
        self._targets = frame.xys(path.points[self._last : path.progress : -2])

    def farthest(self, room_m: float) -> Reach:
        """With this much room kept beside the rover; a reach of 0 m when there is nowhere to be sent."""
        here, stopping = self._view.pose.point, self._stopping(room_m)
        limit = self._view.evidence.frame.cells(self._limit_m)
        found = first_to_stop_at(self._ground, self._start, self._targets, limit, stopping)
        if found < 0:
            return Reach(here, 0.0, room_m)
        index = self._last - 2 * found
        further = [self._path.point(i) for i in (index + 1, index + 2) if i <= self._last]
        target = self._moved_on(self._path.point(index), further, stopping)
        return Reach(target, here.distance_m(target), room_m)

    def _moved_on(self, target: NedPoint, further: list[NedPoint], stopping: Stopping) -> NedPoint:
        """The target moved on towards the next points of the path, which are too far, in steps of ``ROLLED_M``.

        The farther the target, the faster the autopilot drives, so no decimetre is given away.
        """
        steps = self._steps(target, further)
        if not steps:
            return target
        places = np.array([(step.north_m, step.east_m) for step in steps])
        may = stops_in_a_row(self._ground, self._start, self._view.evidence.frame.xys(places), stopping)
        return steps[may - 1] if may else target

    def _steps(self, target: NedPoint, further: list[NedPoint]) -> list[NedPoint]:
        """The places in steps of ``ROLLED_M`` towards these points, as long as each is farther than the last one."""
        here = self._view.pose.point
        distance_m = here.distance_m(target)
        steps: list[NedPoint] = []
        for point in further:
            bearing, left_m = target.bearing_rad(point), target.distance_m(point)
            pieces = max(1, math.ceil(left_m / ROLLED_M - 1e-6))
            for _ in range(pieces):
                target = target.moved(bearing, left_m / pieces)
                before_m, distance_m = distance_m, here.distance_m(target)
                if not before_m < distance_m <= self._limit_m:
                    return steps
                steps.append(target)
        return steps

    def _stopping(self, room_m: float) -> Stopping:
        evidence, radius_m = self._view.evidence, self._view.rover.radius_m
        lengths_m = Stopping(
            radius=radius_m,
            map_radius=evidence.rover_radius_m,
            room=room_m,
            overshoot=self._view.settings.guidance.overshoot_m,
            rolling=overshoot_m(0.0, self._view.speed_m_s, self._view.settings.guidance),
            held=self._view.further_m,
            unsure=UNSURE_M,
            flank=radius_m + FLANK_M,
            near=radius_m + FLANK_NEAR_M,
            slack=ROLLED_M,
            edge=0.01,
        )
        return Stopping(*map(evidence.frame.cells, lengths_m))


def tail_reach_m(radius_m: float, *, backwards: bool) -> float:
    """How far from its middle the rim of a rover that goes backwards must be on seen ground; 0 forwards."""
    return radius_m + FLANK_M if backwards else 0.0


def unseen_flank(view: LocalView, point: NedPoint) -> Unseen | None:
    """Where the rover's flanks would enter unseen ground on the way to a point."""
    radius_m = view.rover.radius_m
    return unseen_beside(view.evidence, view.pose.point, point, radius_m + FLANK_M, radius_m + FLANK_NEAR_M)


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
    mapped_m = _mapped_m(view, tail_rad, reach_m + radius_m) - radius_m
    return min(fastest_m_s, fastest_blind_m_s(min(line.clear_m, line.seen_m, open_m, mapped_m), settings))


def _mapped_m(view: LocalView, bearing_rad: float, reach_m: float) -> float:
    """How far the map goes in a direction, at most ``reach_m``: nothing is known beyond it."""
    base, step_m = view.evidence.base, 0.5 * view.evidence.base.resolution_m
    far_m = 0.0
    while far_m < reach_m and base.contains(base.cell_at(view.pose.point.moved(bearing_rad, far_m + step_m))):
        far_m += step_m
    return min(far_m, reach_m)
