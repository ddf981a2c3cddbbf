"""What a rover might do when something comes across: go on, go on a little, stop, turn and move aside, back off, make off in an arc.

Each choice says what the autopilot would be told and where the rover would then be at each moment. What lies beside the way must be clear
and seen; whether the choice keeps its distance from what moves is judged elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from companion.control.braking import blind_distance_m
from companion.control.motion_prediction import (
    TURN_RAD_S,
    Points,
    ahead,
    braked_m,
    driven_m,
    moved,
    moved_on_arc,
    steered_along,
)
from companion.control.point_controller import STOP, ControlCommand, Motion, turn_to
from companion.control.reference_path import Route
from companion.control.safe_reach import BACK_LEAST_M_S, backing_speed_m_s
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.arc_kernels import UNSEEN, arc_clear, kept_room
from companion.mapping.evidence_map import EvidenceMap, ground_of, in_cells, look_along
from companion.perception.moving_obstacles import Moving
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity

GO_ON_S = (math.inf, 3.0, 1.5, 0.4)
"""How long the rover might go on before it stops, the longest first: 0.4 s is a little more than until it is asked again."""
STRAIGHT_S = 1.0
TURNING_S = 5.0
"""A rover that stands to look about goes on with that as long as nothing comes within this."""
ASIDE_M = (2.5, 1.5)
ASIDE_RAD = (0.5 * math.pi, -0.5 * math.pi, 0.25 * math.pi, -0.25 * math.pi)
"""Where it might move aside to: so far, in these directions from where the other one goes."""
ASIDE_M_S = 1.2
OFF_M = 1.5
"""How far it backs off at most."""
ARC_M, ARC_M_S, ARC_SHARES = 2.5, 0.7, (0.0, -1.0, 1.0)
"""How far, and with which shares of the sharpest curvature, who cannot turn on the spot makes off."""


@dataclass(frozen=True, eq=False, slots=True)
class Situation:
    """The rover at this moment, and the moments from now on that count (``times_s``). ``backwards``: it rolls tail first."""

    pose: Pose
    speed_m_s: float
    evidence: EvidenceMap
    rover: RoverLimits
    settings: Settings
    times_s: Points
    backwards: bool = False

    @property
    def rolls_m(self) -> Points:
        """How far it still rolls if it is told to stop, at each moment."""
        return braked_m(self.speed_m_s, self.times_s, self.settings.guidance)

    def driven_m(self, wanted_m_s: float, goes_s: float) -> Points:
        """How far it drives, at each moment, that goes on for so long with such a speed and then stops."""
        return driven_m(self.speed_m_s, wanted_m_s, goes_s, self.times_s, self.settings.guidance)


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """Something to do, and where the rover then is at each moment; what comes after ``until_s`` does not count.

    ``aside_rad``: which way it then moves aside.
    """

    guide: ControlCommand
    places: Points
    until_s: float = math.inf
    aside_rad: float | None = None


def on_the_way(at: Situation, now: ControlCommand, route: Route | None) -> Iterator[Choice]:
    """Going on, going on a little, stopping."""
    pose, rolls_m = at.pose, at.rolls_m
    halt = Choice(ControlCommand(Motion.BRAKE, STOP, 0.0), ahead(pose, -rolls_m if at.backwards else rolls_m))
    if now.motion is Motion.DRIVE and route is not None:
        way = _told_way(now, route, pose)
        course_rad = pose.heading_rad + (math.pi if at.backwards else 0.0)
        for goes_s in GO_ON_S:
            along_m = at.driven_m(now.speed_m_s, goes_s)
            places = steered_along(way, course_rad, along_m, at.rover.turning_radius_m)
            yield Choice(_nearer(now, pose, along_m), places)
    else:
        yield Choice(now, halt.places, TURNING_S)
    yield halt


def _nearer(now: ControlCommand, pose: Pose, along_m: Points) -> ControlCommand:
    """The same, but told no farther than where the rover is to come to stand: it must stop there also if it is told nothing more."""
    if not isinstance(now.setpoint, GuidedPosition):
        return now
    stands_m, there = float(along_m[-1]), now.setpoint.point
    if stands_m >= pose.point.distance_m(there):
        return now
    nearer = pose.point.moved(pose.point.bearing_rad(there), stands_m)
    return ControlCommand(now.motion, GuidedPosition(nearer), now.speed_m_s)


def _told_way(now: ControlCommand, route: Route, pose: Pose) -> Points:
    """Where it drives: straight to the place that it is told, and on from there along the route.

    That place lies some metres ahead. On a route that turns off before it, a new one that begins sideways above all, the rover goes
    across, and is never where the route is.
    """
    ahead = route.points[route.progress + 1 :]
    here = (pose.north_m, pose.east_m)
    if isinstance(now.setpoint, GuidedPosition) and len(ahead) > 0:
        told = np.array((now.setpoint.point.north_m, now.setpoint.point.east_m))
        nearest = int(np.argmin(((ahead - told) ** 2).sum(axis=1)))
        if nearest > 0:  # else it is not ahead any more
            return np.vstack((here, told, ahead[nearest + 1 :]))
    return np.vstack((here, ahead))


def out_of_the_way(at: Situation, moving: tuple[Moving, ...], aside_rad: float | None) -> Iterator[Choice]:
    """Where the rover might make off to, best first, worked out only when it is asked for."""
    yield from _straight_on(at)
    if aside_rad is not None:
        yield from _aside(at, aside_rad)
    nearest = min(moving, key=lambda one: one.at(at.pose.time_s).distance_m(at.pose.point) - one.radius_m)
    course_rad = math.atan2(nearest.east_m_s, nearest.north_m_s)
    for turned_rad in ASIDE_RAD:
        yield from _aside(at, wrap_pi_rad(course_rad + turned_rad))
    yield from _off(at)


def _straight_on(at: Situation) -> list[Choice]:
    """Straight past, and stop then: a way that has just been laid anew may turn off before what comes across."""
    along_m = at.driven_m(at.speed_m_s, STRAIGHT_S)
    there = at.pose.point.moved(at.pose.heading_rad, float(along_m[-1]))
    if at.speed_m_s <= at.settings.guidance.roll_out_m_s or not _may_stand(at, there):
        return []
    return [Choice(ControlCommand(Motion.LOOK, GuidedPosition(there), at.speed_m_s), ahead(at.pose, along_m))]


def _may_stand(at: Situation, there: NedPoint) -> bool:
    """Whether the way to a place, and a little farther, is clear and seen."""
    here, guidance = at.pose.point, at.settings.guidance
    reach_m = here.distance_m(there) + guidance.overshoot_m
    beyond = here.moved(here.bearing_rad(there), reach_m)
    line = look_along(at.evidence, here, beyond, at.rover.radius_m + guidance.clearance_m)
    return min(line.clear_m, line.seen_m) >= reach_m - 0.05


def _aside(at: Situation, bearing_rad: float) -> list[Choice]:
    """Turn to a bearing and drive a little, if the ground there is free."""
    pose, guidance = at.pose, at.settings.guidance
    error_rad = abs(wrap_pi_rad(bearing_rad - pose.heading_rad))
    turns_s = error_rad / TURN_RAD_S + at.speed_m_s / guidance.deceleration_m_s2
    going_m_s = min(at.rover.cruise_speed_m_s, ASIDE_M_S)
    for aside_m in ASIDE_M:
        there = pose.point.moved(bearing_rad, aside_m)
        if not _may_stand(at, there):
            continue
        after_s = np.maximum(at.times_s - turns_s, 0.0)
        along_m = np.minimum(0.5 * guidance.deceleration_m_s2 * after_s**2, aside_m)
        along_m = np.minimum(along_m, going_m_s * after_s)
        places = moved(ahead(pose, at.rolls_m), bearing_rad, along_m)
        if error_rad > math.radians(guidance.turn_until_close_deg):
            return [Choice(turn_to(bearing_rad, at.speed_m_s, guidance), places, aside_rad=bearing_rad)]
        going = ControlCommand(Motion.LOOK, GuidedPosition(there), going_m_s)
        return [Choice(going, places, aside_rad=bearing_rad)]
    return []


def _off(at: Situation) -> list[Choice]:
    """Straight back over ground that is known to be free."""
    guidance = at.settings.guidance
    back_m_s = backing_speed_m_s(at.pose, at.evidence, at.rover.radius_m, guidance)
    if back_m_s < BACK_LEAST_M_S or at.speed_m_s > guidance.roll_out_m_s + guidance.back_out_speed_m_s:
        return []
    stands_s = guidance.brake_delay_s + at.speed_m_s / guidance.deceleration_m_s2
    back_m = np.minimum(np.maximum(at.times_s - stands_s, 0.0) * back_m_s, OFF_M)
    guide = ControlCommand(Motion.LOOK, GuidedVelocity(-back_m_s, 0.0), back_m_s)
    return [Choice(guide, ahead(at.pose, at.rolls_m - back_m))]


def on_arcs(at: Situation) -> Iterator[Choice]:
    """Where a rover might make off to that cannot turn on the spot: straight or at full lock, the way it rolls; standing, either way."""
    pose, rover, guidance, steering = at.pose, at.rover, at.settings.guidance, at.settings.steering
    ground, scale = ground_of(at.evidence, pose), 1.0 / at.evidence.evidence_m
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), at.evidence)[0].tolist()
    room = kept_room(ground, x, y, (rover.radius_m + guidance.clearance_m) * scale, (rover.radius_m - 0.05) * scale)
    sharpest_m = 1.0 / (rover.turning_radius_m * steering.planned_radius)
    for tail_first in (at.backwards,) if at.speed_m_s > steering.stopped_m_s else (False, True):
        going_m_s = min(guidance.back_out_speed_m_s if tail_first else rover.cruise_speed_m_s, ARC_M_S)
        course_rad = pose.heading_rad + (math.pi if tail_first else 0.0)
        for share in ARC_SHARES:
            curvature_m = share * sharpest_m
            reach = max(ARC_M, blind_distance_m(going_m_s, guidance)) * scale
            if arc_clear(ground, x, y, course_rad, curvature_m / scale, room, reach, UNSEEN) < reach - 1e-6:
                continue
            along_m = np.minimum(at.driven_m(going_m_s, math.inf), ARC_M)
            turn_rate = curvature_m * max(at.speed_m_s, steering.scale_base_m_s)
            setpoint = GuidedVelocity(-going_m_s if tail_first else going_m_s, round(turn_rate, 2))
            places = moved_on_arc(pose, course_rad, curvature_m, along_m)
            yield Choice(ControlCommand(Motion.LOOK, setpoint, going_m_s), places)
