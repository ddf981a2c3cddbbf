"""Making way for what moves: before the rover does what guidance says, it looks a few seconds ahead.

Several things that it might do now are played through against everything that moves: go on, go on a little and then stop, stop at
once, turn and move aside, back off. The first that keeps its distance is done; if none does, the one that leaves the most
room, and if all would touch something, the one that goes well for longest. The rover stops before the others' way, since going on is allowed only while there still is somewhere to stop; and it
waits there until going on is safe again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from companion.commands import GuidedPosition, GuidedVelocity
from companion.frames import NedPoint, Pose, wrap_pi_rad
from companion.guidance import STOP, Guide, Motion, turn_to
from companion.mapping import EvidenceMap, ground_of, in_cells, look_along
from companion.prediction import (
    PERIOD_S,
    TURN_RAD_S,
    Points,
    ahead,
    braked_m,
    driven_m,
    moved,
    moved_on_arc,
    steered_along,
)
from companion.reach import BACK_LEAST_M_S, RoverLimits, backing_speed_m_s
from companion.route import Route
from companion.settings import GuidanceSettings, Settings
from companion.stopping import blind_distance_m
from companion.swept import UNSEEN, arc_clear, kept_room
from companion.traffic import Moving

GO_ON_S = (math.inf, 3.0, 1.5, 0.4)
"""How long the rover might go on before it stops, the longest first: 0.4 s is a little more than until it is asked again."""
MARGIN_SHARES = (1.0, 0.5)
"""Rather less of the margin than out of the way altogether."""
STRAIGHT_S = 1.0
NEAR_M = 0.15
"""Where everything would touch something in the end, what keeps from coming so near for longest is done."""
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
class Choice:
    """Something to do, and where the rover then is at each moment; what comes after ``until_s`` does not count.

    ``aside_rad``: which way it then moves aside.
    """

    guide: Guide
    places: Points
    until_s: float = math.inf
    aside_rad: float | None = None


def yielded(
    now: Guide,
    route: Route | None,
    pose: Pose,
    speed_m_s: float,
    moving: tuple[Moving, ...],
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: Settings,
    aside_rad: float | None = None,
    *,
    backwards: bool = False,
) -> tuple[Guide, float | None]:
    """What to do instead of ``now`` because of what moves; ``now`` itself if nothing comes across.

    Also which way the rover moves aside, if it does; handed in again as ``aside_rad`` it keeps to that.
    ``backwards``: it rolls tail first.
    """
    moving = tuple(one for one in moving if _matters(one, pose, rover, settings))
    if not moving:
        return now, None
    times_s = np.arange(0.0, settings.traffic.look_s + 1e-9, PERIOD_S)
    discs = _discs(moving, pose, rover)
    margins_m = settings.traffic.margin_m + settings.traffic.drift_m_s * times_s

    def room_m(choice: Choice, share: float) -> float:
        return least_room_m(choice.places, discs, times_s, share * margins_m, choice.until_s)

    on_the_way = list(_on_the_way(now, route, pose, speed_m_s, rover, settings.guidance, times_s, backwards))
    for share in MARGIN_SHARES:
        for choice in on_the_way:
            if room_m(choice, share) >= 0.0:
                return choice.guide, None
    choices = on_the_way
    if rover.turning_radius_m > 0.0:
        away = _on_arcs(pose, speed_m_s, evidence, rover, settings, times_s, backwards)
    else:
        away = _out_of_the_way(pose, speed_m_s, moving, evidence, rover, settings.guidance, times_s, aside_rad)
    for choice in away:
        if room_m(choice, MARGIN_SHARES[-1]) >= 0.0:
            return choice.guide, choice.aside_rad
        choices.append(choice)

    def worth(choice: Choice) -> tuple[bool, float, float]:
        first_s, least_m = first_near(choice.places, discs, times_s, NEAR_M)
        return (True, least_m, 0.0) if least_m >= 0.0 else (False, first_s, least_m)

    best = max(choices, key=worth)
    return best.guide, best.aside_rad


def _matters(one: Moving, pose: Pose, rover: RoverLimits, settings: Settings) -> bool:
    """Whether it moves at all and the two could meet while the rover looks ahead."""
    traffic = settings.traffic
    reach_m = (one.speed_m_s + rover.cruise_speed_m_s) * traffic.look_s + one.radius_m + rover.radius_m
    return one.speed_m_s >= traffic.moving_m_s and one.at(pose.time_s).distance_m(pose.point) <= reach_m


def _discs(moving: tuple[Moving, ...], pose: Pose, rover: RoverLimits) -> Points:
    """Rows for ``least_room_m``: place now, velocity, and how near the middles may come."""
    rows = []
    for one in moving:
        here = one.at(pose.time_s)
        rows.append((here.north_m, here.east_m, one.north_m_s, one.east_m_s, one.radius_m + rover.radius_m))
    return np.array(rows)


@njit(cache=True, nogil=True)
def least_room_m(places: Points, discs: Points, times_s: Points, margins_m: Points, until_s: float) -> float:
    """The least room beyond the margin that is left between the rover and anything that moves; negative: too little.

    What is nearer than the margin already must not come nearer still.
    """
    least_m = math.inf
    for row in range(discs.shape[0]):
        north_m, east_m, north_m_s, east_m_s, touch_m = discs[row]
        now_m = math.hypot(north_m - places[0, 0], east_m - places[0, 1]) - touch_m
        for i in range(times_s.size):
            time_s = times_s[i]
            if time_s > until_s:
                break
            to_n, to_e = north_m + north_m_s * time_s - places[i, 0], east_m + east_m_s * time_s - places[i, 1]
            room_m = math.hypot(to_n, to_e) - touch_m - min(margins_m[i], max(now_m - 0.02, 0.0))
            least_m = min(least_m, room_m)
    return least_m


@njit(cache=True, nogil=True)
def first_near(places: Points, discs: Points, times_s: Points, near_m: float) -> tuple[float, float]:
    """When anything that moves first comes within ``near_m`` of the rover (inf: never), and the least room there is at any time."""
    first_s, least_m = math.inf, math.inf
    for row in range(discs.shape[0]):
        north_m, east_m, north_m_s, east_m_s, touch_m = discs[row]
        for i in range(times_s.size):
            to_n = north_m + north_m_s * times_s[i] - places[i, 0]
            to_e = east_m + east_m_s * times_s[i] - places[i, 1]
            room_m = math.hypot(to_n, to_e) - touch_m
            least_m = min(least_m, room_m)
            if room_m < near_m and times_s[i] < first_s:
                first_s = times_s[i]
    return first_s, least_m


def _on_the_way(
    now: Guide,
    route: Route | None,
    pose: Pose,
    speed_m_s: float,
    rover: RoverLimits,
    settings: GuidanceSettings,
    times_s: Points,
    backwards: bool,
) -> Iterator[Choice]:
    """Going on, going on a little, stopping."""
    rolls_m = braked_m(speed_m_s, times_s, settings)
    halt = Choice(Guide(Motion.BRAKE, STOP, 0.0), ahead(pose, -rolls_m if backwards else rolls_m))
    if now.motion is Motion.DRIVE and route is not None:
        way = _told_way(now, route, pose)
        course_rad = pose.heading_rad + (math.pi if backwards else 0.0)
        for goes_s in GO_ON_S:
            along_m = driven_m(speed_m_s, now.speed_m_s, goes_s, times_s, settings)
            places = steered_along(way, course_rad, along_m, rover.turning_radius_m)
            yield Choice(_nearer(now, pose, along_m), places)
    else:
        yield Choice(now, halt.places, TURNING_S)
    yield halt


def _nearer(now: Guide, pose: Pose, along_m: Points) -> Guide:
    """The same, but told no farther than where the rover is to come to stand: it must stop there also if it is told nothing more."""
    if not isinstance(now.setpoint, GuidedPosition):
        return now
    stands_m, there = float(along_m[-1]), now.setpoint.point
    if stands_m >= pose.point.distance_m(there):
        return now
    nearer = pose.point.moved(pose.point.bearing_rad(there), stands_m)
    return Guide(now.motion, GuidedPosition(nearer), now.speed_m_s)


def _out_of_the_way(
    pose: Pose,
    speed_m_s: float,
    moving: tuple[Moving, ...],
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    times_s: Points,
    aside_rad: float | None,
) -> Iterator[Choice]:
    """Where the rover might make off to, best first, worked out only when it is asked for."""
    yield from _straight_on(pose, speed_m_s, evidence, rover, settings, times_s)
    if aside_rad is not None:
        yield from _aside(aside_rad, pose, speed_m_s, evidence, rover, settings, times_s)
    nearest = min(moving, key=lambda one: one.at(pose.time_s).distance_m(pose.point) - one.radius_m)
    course_rad = math.atan2(nearest.east_m_s, nearest.north_m_s)
    for turned_rad in ASIDE_RAD:
        bearing_rad = wrap_pi_rad(course_rad + turned_rad)
        yield from _aside(bearing_rad, pose, speed_m_s, evidence, rover, settings, times_s)
    yield from _off(pose, speed_m_s, evidence, rover, settings, times_s)


def _straight_on(
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    times_s: Points,
) -> list[Choice]:
    """Straight past, and stop then: a way that has just been laid anew may turn off before what comes across."""
    along_m = driven_m(speed_m_s, speed_m_s, STRAIGHT_S, times_s, settings)
    length_m = float(along_m[-1])
    there = pose.point.moved(pose.heading_rad, length_m)
    if speed_m_s <= settings.roll_out_m_s or not _may_stand(there, pose, evidence, rover, settings):
        return []
    return [Choice(Guide(Motion.LOOK, GuidedPosition(there), speed_m_s), ahead(pose, along_m))]


def _may_stand(
    there: NedPoint, pose: Pose, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings
) -> bool:
    """Whether the way to a place, and a little farther, is clear and seen."""
    reach_m = pose.point.distance_m(there) + settings.overshoot_m
    beyond = pose.point.moved(pose.point.bearing_rad(there), reach_m)
    line = look_along(evidence, pose.point, beyond, rover.radius_m + settings.clearance_m)
    return min(line.clear_m, line.seen_m) >= reach_m - 0.05


def _aside(
    bearing_rad: float,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    times_s: Points,
) -> list[Choice]:
    """Turn to a bearing and drive a little, if the ground there is free."""
    error_rad = abs(wrap_pi_rad(bearing_rad - pose.heading_rad))
    turns_s = error_rad / TURN_RAD_S + speed_m_s / settings.deceleration_m_s2
    for aside_m in ASIDE_M:
        there = pose.point.moved(bearing_rad, aside_m)
        if not _may_stand(there, pose, evidence, rover, settings):
            continue
        after_s = np.maximum(times_s - turns_s, 0.0)
        along_m = np.minimum(0.5 * settings.deceleration_m_s2 * after_s**2, aside_m)
        along_m = np.minimum(along_m, min(rover.cruise_speed_m_s, ASIDE_M_S) * after_s)
        places = moved(ahead(pose, braked_m(speed_m_s, times_s, settings)), bearing_rad, along_m)
        if error_rad > math.radians(settings.turn_until_close_deg):
            return [Choice(turn_to(bearing_rad, speed_m_s, settings), places, aside_rad=bearing_rad)]
        going_m_s = min(rover.cruise_speed_m_s, ASIDE_M_S)
        going = Guide(Motion.LOOK, GuidedPosition(there), going_m_s)
        return [Choice(going, places, aside_rad=bearing_rad)]
    return []


def _off(
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    times_s: Points,
) -> list[Choice]:
    """Straight back over ground that is known to be free."""
    back_m_s = backing_speed_m_s(pose, evidence, rover.radius_m, settings)
    if back_m_s < BACK_LEAST_M_S or speed_m_s > settings.roll_out_m_s + settings.back_out_speed_m_s:
        return []
    stands_s = settings.brake_delay_s + speed_m_s / settings.deceleration_m_s2
    back_m = np.minimum(np.maximum(times_s - stands_s, 0.0) * back_m_s, OFF_M)
    guide = Guide(Motion.LOOK, GuidedVelocity(-back_m_s, 0.0), back_m_s)
    return [Choice(guide, ahead(pose, braked_m(speed_m_s, times_s, settings) - back_m))]


def _on_arcs(
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: Settings,
    times_s: Points,
    backwards: bool,
) -> Iterator[Choice]:
    """Where a rover might make off to that cannot turn on the spot: straight or at full lock, the way it rolls; standing, either way."""
    guidance, ground = settings.guidance, ground_of(evidence, pose)
    rolls, scale = speed_m_s > settings.steering.stopped_m_s, 1.0 / evidence.evidence_m
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0].tolist()
    room = kept_room(ground, x, y, (rover.radius_m + guidance.clearance_m) * scale, (rover.radius_m - 0.05) * scale)
    sharpest_m = 1.0 / (rover.turning_radius_m * settings.steering.planned_radius)
    for tail_first in (backwards,) if rolls else (False, True):
        going_m_s = min(guidance.back_out_speed_m_s if tail_first else rover.cruise_speed_m_s, ARC_M_S)
        course_rad = pose.heading_rad + (math.pi if tail_first else 0.0)
        for share in ARC_SHARES:
            curvature_m = share * sharpest_m
            reach = max(ARC_M, blind_distance_m(going_m_s, guidance)) * scale
            if arc_clear(ground, x, y, course_rad, curvature_m / scale, room, reach, UNSEEN) < reach - 1e-6:
                continue
            along_m = np.minimum(driven_m(speed_m_s, going_m_s, math.inf, times_s, guidance), ARC_M)
            turn_rate = curvature_m * max(speed_m_s, settings.steering.scale_base_m_s)
            setpoint = GuidedVelocity(-going_m_s if tail_first else going_m_s, round(turn_rate, 2))
            places = moved_on_arc(pose, course_rad, curvature_m, along_m)
            yield Choice(Guide(Motion.LOOK, setpoint, going_m_s), places)


def _told_way(now: Guide, route: Route, pose: Pose) -> Points:
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
