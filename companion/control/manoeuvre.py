"""Manoeuvres: short ways of arcs for a rover that cannot turn on the spot, back to its route when it cannot simply drive on along it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from companion.control.hybrid_astar import HEADINGS, Means, Poses, Wish, find
from companion.control.reference_path import STEP_M, Points, Route
from companion.core.frames import NedPoint, Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.arc_kernels import Ground, kept_room
from companion.mapping.evidence_map import EvidenceMap, ground_of, in_cells
from companion.settings import SteeringSettings

ALIGNED_RAD = math.radians(25.0)
"""Headings that differ by less are the same to a rover that follows a line."""
HEADING_RAD = 2.0 * math.pi / HEADINGS
BIN_M, LEAST_ARC_M = 0.25, 0.5
WINDOW_RADII, LEAST_WINDOW_M = 4.0, 8.0
AHEAD_RADII, LEAST_AHEAD_M = (2.0, 1.2, 3.2), 2.0
"""The place on the route to come back to lies so many turning radii ahead, tried in turn."""
ANY_RAD = math.pi


@dataclass(frozen=True, eq=False, slots=True)
class Leg:
    """A piece driven in one direction. ``points``: shape (n, 2), north and east in metres, ``STEP_M`` apart or less."""

    points: Points
    backwards: bool

    @property
    def end(self) -> NedPoint:
        """Where it ends."""
        return NedPoint(float(self.points[-1, 0]), float(self.points[-1, 1]))


@dataclass(frozen=True, eq=False, slots=True)
class Manoeuvre:
    """Legs to drive one after the other, and how far along the first one the rover has come."""

    legs: tuple[Leg, ...]
    progress: int = 0

    @property
    def end(self) -> NedPoint:
        """Where it leads."""
        return self.legs[-1].end

    @property
    def leg(self) -> Leg:
        """The one being driven."""
        return self.legs[0]

    def after_leg(self) -> Manoeuvre | None:
        """What is left when this leg is done."""
        return Manoeuvre(self.legs[1:]) if len(self.legs) > 1 else None

    def at(self, progress: int) -> Manoeuvre:
        """The same, farther along its leg."""
        return replace(self, progress=progress)

    def as_route(self) -> Route:
        """All that is left as one line."""
        points = np.vstack([leg.points for leg in self.legs])
        return Route(points, min(self.progress, len(points) - 1))


@dataclass(frozen=True, slots=True)
class Try:
    """One way to look for a manoeuvre: to the place so far ahead on the route, with so much room beside the rover's radius."""

    ahead_m: float
    clearance_m: float


def tries(route: Route, rover: RoverLimits, settings: SteeringSettings) -> tuple[Try, ...]:
    """What to try one after the other: near and roomy first."""
    clearances_m = (settings.narrow_clearance_m,) if rover.narrow_sight else settings.clearances_m
    aheads_m = [max(radii * rover.turning_radius_m, LEAST_AHEAD_M) for radii in AHEAD_RADII]
    while len(aheads_m) > 1 and route.left_m <= aheads_m[-2]:
        aheads_m.pop()
    return tuple(Try(ahead_m, clearance_m) for ahead_m in aheads_m for clearance_m in clearances_m)


def find_manoeuvre(
    route: Route,
    pose: Pose,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: SteeringSettings,
    wanted: Try,
    first_way: int = 0,
) -> Manoeuvre | None:
    """A way of arcs to a place ahead on the route; None when none was found.

    ``first_way``: 1 if it must begin forwards, since the rover rolls so, -1 for backwards, 0 for either.
    """
    ground = ground_of(evidence, pose)
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0].tolist()
    wish = _wish(route, wanted.ahead_m, evidence, rover, settings)
    means = _means((x, y), ground, evidence, rover, settings, wanted.clearance_m, first_way)
    way = find(ground, x, y, pose.heading_rad, wish, means)
    return _manoeuvre(way, evidence) if len(way) > 1 else None


def _wish(route: Route, ahead_m: float, evidence: EvidenceMap, rover: RoverLimits, settings: SteeringSettings) -> Wish:
    there = route.point_ahead(ahead_m)
    x, y = in_cells(np.array([[there.north_m, there.east_m]]), evidence)[0]
    scale = 1.0 / evidence.evidence_m
    if route.left_m <= ahead_m:
        return Wish(x, y, 0.0, settings.end_within_m * scale, ANY_RAD, 0.0)
    heading_rad = route.point_ahead(ahead_m - 1.0).bearing_rad(route.point_ahead(ahead_m + 0.5))
    return Wish(
        x,
        y,
        heading_rad,
        settings.join_within_m * scale,
        ALIGNED_RAD,
        settings.turned_cost_radii * rover.turning_radius_m * scale,
    )


def _means(
    here: tuple[float, float],
    ground: Ground,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: SteeringSettings,
    clearance_m: float,
    first_way: int,
) -> Means:
    scale = 1.0 / evidence.evidence_m
    radius_m = rover.turning_radius_m * settings.planned_radius
    room = kept_room(ground, here[0], here[1], (rover.radius_m + clearance_m) * scale, (rover.radius_m - 0.05) * scale)
    return Means(
        sharpest=1.0 / (radius_m * scale),
        # A step at full lock must lead to another heading, or it is told from a straight one by its cost alone.
        step=max(LEAST_ARC_M, 1.05 * HEADING_RAD * radius_m) * scale,
        window=math.ceil(max(WINDOW_RADII * rover.turning_radius_m, LEAST_WINDOW_M) * scale),
        bin=max(1, round(BIN_M * scale)),
        room=room,
        switch_cost=settings.switch_cost_m * scale,
        first_way=first_way,
        expansions=settings.most_poses,
    )


def _manoeuvre(way: Poses, evidence: EvidenceMap) -> Manoeuvre:
    """The legs of a way: a new one wherever its direction changes."""
    legs: list[Leg] = []
    begin = 0
    for i in range(1, len(way)):
        if i == len(way) - 1 or way[i + 1, 3] != way[i, 3]:
            legs.append(Leg(_drawn(way[begin : i + 1], evidence), bool(way[i, 3] < 0.0)))
            begin = i
    return Manoeuvre(tuple(legs))


def _drawn(way: Poses, evidence: EvidenceMap) -> Points:
    """The arcs between poses as points not more than ``STEP_M`` apart."""
    corner = evidence.base.south_west
    lines = [way[:1, :2]]
    for start, end in pairwise(way):
        chord = math.hypot(end[0] - start[0], end[1] - start[1])
        pieces = max(1, math.ceil(chord * evidence.evidence_m / STEP_M))
        turned, length = (end[2] - start[2]) / pieces, end[3] * chord / pieces
        if abs(end[2] - start[2]) > 1e-9:
            length *= abs(math.sin(turned / 2.0) * pieces / math.sin((end[2] - start[2]) / 2.0))
        place = np.array(start[:3])
        points = np.empty((pieces, 2))
        for i in range(pieces):
            middle = place[2] + 0.5 * turned
            place += (length * math.sin(middle), length * math.cos(middle), turned)
            points[i] = place[:2]
        lines.append(points)
    cells = np.vstack(lines) * evidence.evidence_m
    return np.column_stack((cells[:, 1] + corner.north_m, cells[:, 0] + corner.east_m))
