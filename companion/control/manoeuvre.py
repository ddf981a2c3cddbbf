"""Manoeuvres: short ways of arcs, forwards and backwards, back to the path.

Nouns: manoeuvre, arc segment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from companion.control.hybrid_astar import HEADINGS, ArcLimits, GoalRegion, Poses, find
from companion.control.local_view import LocalView
from companion.control.reference_path import STEP_M, Points, ReferencePath
from companion.control.safe_reach import FLANK_M
from companion.core.frames import NedPoint
from companion.core.rover_limits import RoverLimits
from companion.mapping.cell_frame import CellFrame
from companion.mapping.map_queries import ArcQueries, ground_at
from companion.settings import SteeringSettings

ALIGNED_RAD = math.radians(25.0)
"""Headings that differ by less are the same to a rover that follows a line."""
HEADING_RAD = 2.0 * math.pi / HEADINGS
BIN_M, LEAST_ARC_M = 0.25, 0.5
WINDOW_RADII, LEAST_WINDOW_M = 4.0, 8.0
AHEAD_RADII, LEAST_AHEAD_M = (2.0, 1.2, 3.2), 2.0
"""How far ahead on the path the place to come back to lies, in turning radii, tried in turn."""
ANY_RAD = math.pi


@dataclass(frozen=True, eq=False, slots=True)
class ArcSegment:
    """Driven in one direction. ``points``: shape (n, 2), north and east in metres, ``STEP_M`` apart or less."""

    points: Points
    backwards: bool

    @property
    def end(self) -> NedPoint:
        """Where it ends."""
        return NedPoint(float(self.points[-1, 0]), float(self.points[-1, 1]))


@dataclass(frozen=True, eq=False, slots=True)
class Manoeuvre:
    """Segments to drive one after the other, and the index of the point of the first one that the rover has come to."""

    segments: tuple[ArcSegment, ...]
    progress: int = 0

    @property
    def end(self) -> NedPoint:
        """Where it leads."""
        return self.segments[-1].end

    @property
    def segment(self) -> ArcSegment:
        """The one being driven."""
        return self.segments[0]

    def after_segment(self) -> Manoeuvre | None:
        """What is left when this segment is done."""
        return Manoeuvre(self.segments[1:]) if len(self.segments) > 1 else None

    def at(self, progress: int) -> Manoeuvre:
        """The same, farther along its segment."""
        return replace(self, progress=progress)

    def as_path(self) -> ReferencePath:
        """All that is left as one line."""
        points = np.vstack([segment.points for segment in self.segments])
        return ReferencePath(points, min(self.progress, len(points) - 1))


@dataclass(frozen=True, slots=True)
class Try:
    """One way to look for a manoeuvre: to a place this far ahead on the path, with this room beside the rover."""

    ahead_m: float
    clearance_m: float


def tries(path: ReferencePath, rover: RoverLimits, settings: SteeringSettings) -> tuple[Try, ...]:
    """What to try one after the other: near and roomy first."""
    clearances_m = (settings.narrow_clearance_m,) if rover.narrow_sight else settings.clearances_m
    aheads_m = [max(radii * rover.turning_radius_m, LEAST_AHEAD_M) for radii in AHEAD_RADII]
    while len(aheads_m) > 1 and path.left_m <= aheads_m[-2]:
        aheads_m.pop()
    return tuple(Try(ahead_m, clearance_m) for ahead_m in aheads_m for clearance_m in clearances_m)


def find_manoeuvre(path: ReferencePath, view: LocalView, wanted: Try, first_way: int = 0) -> Manoeuvre | None:
    """A way of arcs to a place ahead on the path; None when none was found.

    ``first_way``: 1 if it must begin forwards, since the rover rolls that way, -1 for backwards, 0 for either.
    """
    frame, pose = view.evidence.frame, view.pose
    x, y = frame.xy(pose.point)
    goal, limits = _goal_region(path, wanted.ahead_m, view), _arc_limits(view, wanted.clearance_m, first_way)
    way = find(ground_at(view.evidence, pose), x, y, pose.heading_rad, goal, limits)
    return _manoeuvre(way, frame) if len(way) > 1 else None


def _goal_region(path: ReferencePath, ahead_m: float, view: LocalView) -> GoalRegion:
    frame, settings = view.evidence.frame, view.settings.steering
    x, y = frame.xy(path.point_ahead(ahead_m))
    if path.left_m <= ahead_m:
        return GoalRegion(x, y, 0.0, frame.cells(settings.end_within_m), ANY_RAD, 0.0)
    heading_rad = path.point_ahead(ahead_m - 1.0).bearing_rad(path.point_ahead(ahead_m + 0.5))
    turned_cost_m = settings.turned_cost_radii * view.rover.turning_radius_m
    return GoalRegion(x, y, heading_rad, frame.cells(settings.join_within_m), ALIGNED_RAD, frame.cells(turned_cost_m))


def _arc_limits(view: LocalView, clearance_m: float, first_way: int) -> ArcLimits:
    frame, rover, settings = view.evidence.frame, view.rover, view.settings.steering
    planned_radius_m = rover.turning_radius_m * settings.planned_radius
    room_m = ArcQueries(view.evidence, view.pose).kept_room_m(rover.radius_m + clearance_m, rover.radius_m - 0.05)
    return ArcLimits(
        sharpest=1.0 / frame.cells(planned_radius_m),
        # A step at full lock must lead to another heading, or only its cost tells it from a straight one.
        step=frame.cells(max(LEAST_ARC_M, 1.05 * HEADING_RAD * planned_radius_m)),
        window=math.ceil(frame.cells(max(WINDOW_RADII * rover.turning_radius_m, LEAST_WINDOW_M))),
        bin=max(1, round(frame.cells(BIN_M))),
        room=frame.cells(room_m),
        # The map may be off by decimetres: no nearer to unseen ground than to obstacles.
        tail=frame.cells(rover.radius_m + max(FLANK_M, clearance_m)),
        switch_cost=frame.cells(settings.switch_cost_m),
        first_way=first_way,
        expansions=settings.most_poses,
    )


def _manoeuvre(way: Poses, frame: CellFrame) -> Manoeuvre:
    """The segments of a way: a new one wherever its direction changes."""
    segments: list[ArcSegment] = []
    begin = 0
    for i in range(1, len(way)):
        if i == len(way) - 1 or way[i + 1, 3] != way[i, 3]:
            segments.append(ArcSegment(_drawn(way[begin : i + 1], frame), bool(way[i, 3] < 0.0)))
            begin = i
    return Manoeuvre(tuple(segments))


def _drawn(way: Poses, frame: CellFrame) -> Points:
    """The arcs between poses as points in metres, not more than ``STEP_M`` apart."""
    lines = [way[:1, :2]]
    for start, end in pairwise(way):
        chord = math.hypot(end[0] - start[0], end[1] - start[1])
        pieces = max(1, math.ceil(frame.metres(chord) / STEP_M))
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
    return frame.points(np.vstack(lines))
