"""Making way for what moves: before the rover does what guidance says, it looks a few seconds ahead.

Several things that it might do now are played through against everything that moves: go on, go on a little and then stop, stop at
once, turn and move aside, back off. The first that keeps its distance is done; if none does, the one that leaves the most
room, and if all would touch something, the one that goes well for longest. The rover stops before the others' way, since going on
is allowed only while there still is somewhere to stop; and it waits there until going on is safe again.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from companion.control.evasion import Choice, Situation, on_arcs, on_the_way, out_of_the_way
from companion.control.motion_prediction import PERIOD_S, Points
from companion.control.point_controller import ControlCommand
from companion.control.reference_path import Route
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.perception.moving_obstacles import Moving
from companion.settings import Settings

MARGIN_SHARES = (1.0, 0.5)
"""Rather less of the margin than out of the way altogether."""
NEAR_M = 0.15
"""Where everything would touch something in the end, what keeps from coming so near for longest is done."""


def yielded(
    now: ControlCommand,
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
) -> tuple[ControlCommand, float | None]:
    """What to do instead of ``now`` because of what moves; ``now`` itself if nothing comes across.

    Also which way the rover moves aside, if it does; handed in again as ``aside_rad`` it keeps to that.
    ``backwards``: it rolls tail first.
    """
    moving = tuple(one for one in moving if _matters(one, pose, rover, settings))
    if not moving:
        return now, None
    times_s = np.arange(0.0, settings.traffic.look_s + 1e-9, PERIOD_S)
    at = Situation(pose, speed_m_s, evidence, rover, settings, times_s, backwards)
    discs = _discs(moving, pose, rover)
    margins_m = settings.traffic.margin_m + settings.traffic.drift_m_s * times_s

    def room_m(choice: Choice, share: float) -> float:
        return least_room_m(choice.places, discs, times_s, share * margins_m, choice.until_s)

    choices = list(on_the_way(at, now, route))
    for share in MARGIN_SHARES:
        for choice in choices:
            if room_m(choice, share) >= 0.0:
                return choice.guide, None
    for choice in on_arcs(at) if rover.turning_radius_m > 0.0 else out_of_the_way(at, moving, aside_rad):
        if room_m(choice, MARGIN_SHARES[-1]) >= 0.0:
            return choice.guide, choice.aside_rad
        choices.append(choice)

    def worth(choice: Choice) -> tuple[bool, float, float]:
        first_s, least_m = first_near(choice.places, discs, times_s, NEAR_M)
        return (True, least_m, 0.0) if least_m >= 0.0 else (False, first_s, least_m)

    best = max(choices, key=worth)
    return best.guide, best.aside_rad


class CollisionAvoidance:
    """Makes way on behalf of one rover, and keeps in mind where it moves aside to and since when it has not got on."""

    def __init__(self, evidence: EvidenceMap, rover: RoverLimits) -> None:
        self._evidence = evidence
        self._rover = rover
        self._aside_rad: float | None = None
        self._since_s: float | None = None

    def give(
        self,
        now: ControlCommand,
        route: Route | None,
        pose: Pose,
        speed_m_s: float,
        moving: tuple[Moving, ...],
        settings: Settings,
        *,
        backwards: bool,
    ) -> ControlCommand:
        """What to do instead of ``now``, as ``yielded`` says."""
        evidence, rover, aside_rad = self._evidence, self._rover, self._aside_rad
        guide, self._aside_rad = yielded(
            now, route, pose, speed_m_s, moving, evidence, rover, settings, aside_rad, backwards=backwards
        )
        return guide

    def is_patient(self, now_s: float, patience_s: float, *, yields: bool) -> bool:
        """Whether the rover is kept from getting on by making way (``yields``: at this moment), and that not for too long yet."""
        if not yields:
            self._since_s = None
            return False
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s < patience_s


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
