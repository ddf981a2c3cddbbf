"""The reference path: the line to drive in metres, from a planned path, and how far the rover has come on it.

Nouns: reference path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint, Pose
from companion.core.grid import Cell, Grid
from companion.mapping.evidence_map import EvidenceMap
from companion.mapping.map_queries import clearance_m, look_along
from companion.planning.problem import Path

Points = NDArray[np.float64]
"""Shape (n, 2): columns north_m and east_m in the local frame."""

STEP_M = 0.25
OFF_M, NEARER_M, REJOIN_M = 1.0, 0.5, 20.0
"""A rover farther than the first from where it has come to on its path looks for a place that is nearer, by the second,
on so much of what is left."""
ASIDE_M, ASIDE_STEP_M = 0.3, 0.025
"""In narrow places a path is moved aside by so much at most, in such steps."""


@dataclass(frozen=True, eq=False, slots=True)
class ReferencePath:
    """The line to drive, in points ``STEP_M`` apart; ``progress``: index of the point that the rover has come to."""

    points: Points
    progress: int = 0
    speeds_m_s: NDArray[np.float64] | None = None
    """Shape (n,): the planned speed at each of the points, if the planner chooses speeds."""

    @property
    def end(self) -> NedPoint:
        """The last point."""
        return self.point(-1)

    def point(self, index: int) -> NedPoint:
        """One of the points."""
        return NedPoint(float(self.points[index, 0]), float(self.points[index, 1]))

    def point_ahead(self, distance_m: float) -> NedPoint:
        """The point at a distance ahead of the rover, along the path; at most its end."""
        return self.point(min(self.progress + round(distance_m / STEP_M), len(self.points) - 1))

    @property
    def planned_m_s(self) -> float:
        """The planned speed where the rover is now; inf when none was planned."""
        return math.inf if self.speeds_m_s is None else float(self.speeds_m_s[self.progress])

    @property
    def left_m(self) -> float:
        """Length of the path that is left, in metres."""
        return (len(self.points) - 1 - self.progress) * STEP_M


def path_along_fields(grid: Grid, cells: tuple[Cell, ...], start: NedPoint, end: NedPoint | None) -> ReferencePath:
    """The path from ``start`` (in the first field) through the middles of the others; ``end`` replaces the last one."""
    corners = [start, *(grid.centre_of(cell) for cell in cells[1:])]
    if end is not None:
        corners[-1 if len(corners) > 1 else 1 :] = [end]
    return ReferencePath(_densified(np.array([(p.north_m, p.east_m) for p in corners])))


def path_along_curve(grid: Grid, curve: NDArray[np.float64], start: NedPoint, end: NedPoint | None) -> ReferencePath:
    """The path along a planner's smooth curve (x, y in fields); ``start`` and ``end`` replace its ends."""
    points = grid.places_of(curve)
    points[0] = (start.north_m, start.east_m)
    if end is not None:
        points[-1] = (end.north_m, end.east_m)
    return ReferencePath(_densified(points))


def reference_path(
    planned: Path | None,
    cells: tuple[Cell, ...],
    evidence: EvidenceMap,
    start: NedPoint,
    end: NedPoint | None,
    half_width_m: float,
) -> ReferencePath:
    """The line along a planned path: along its curve where a rover of this half width can, else through fields.

    ``cells`` are those fields, or the way back (``planned`` is None then). ``start`` and ``end`` replace the ends.
    """
    grid = evidence.grid
    if planned is not None and planned.curve is not None:
        path = path_along_curve(grid, planned.curve, start, end)
        if path_is_clear(path, evidence, half_width_m):
            return with_planned_speeds(path, planned, grid.resolution_m)
    path = centred(path_along_fields(grid, cells, start, end), evidence, half_width_m)
    return path if planned is None else with_planned_speeds(path, planned, grid.resolution_m)


def centred(path: ReferencePath, evidence: EvidenceMap, half_width_m: float) -> ReferencePath:
    """The path, moved aside in narrow places, by no more than a field's side, to where there is most room.

    A path leads through the middles of fields; a gap that a rover of this half width just fits through lies between.
    Fields that are wider than the rover's radius are too coarse for such gaps, and their paths stay as they are.
    """
    if evidence.base.resolution_m > evidence.rover_radius_m:
        return path
    points = path.points.copy()
    most_m = min(evidence.base.resolution_m, ASIDE_M)
    sides = np.arange(-round(most_m / ASIDE_STEP_M), round(most_m / ASIDE_STEP_M) + 1) * ASIDE_STEP_M
    sides = sides[np.argsort(np.abs(sides), kind="stable")]
    wanted_m = half_width_m + evidence.evidence_m
    for i in range(1, len(points) - 1):
        if clearance_m(evidence, path.point(i), wanted_m) >= wanted_m:
            continue
        way = path.points[min(i + 2, len(points) - 1)] - path.points[max(i - 2, 0)]
        normal = np.array((-way[1], way[0])) / max(float(np.hypot(*way)), 1e-9)
        places = path.points[i] + sides[:, None] * normal
        rooms_m = [clearance_m(evidence, NedPoint(float(n), float(e)), wanted_m) for n, e in places]
        points[i] = places[int(np.argmax(rooms_m))]
    return ReferencePath(points, path.progress, path.speeds_m_s)


def path_is_clear(path: ReferencePath, evidence: EvidenceMap, half_width_m: float) -> bool:
    """Whether a rover of this half width can drive the whole path on the map as known."""
    stride = max(1, round(evidence.base.resolution_m / STEP_M))
    stops = [*range(0, len(path.points) - 1, stride), len(path.points) - 1]
    for i, j in pairwise(stops):
        here, there = path.point(i), path.point(j)
        if look_along(evidence, here, there, half_width_m).clear_m < here.distance_m(there) - 1e-6:
            return False
    return True


def advanced(path: ReferencePath, pose: Pose, window_m: float = 4.0) -> ReferencePath:
    """The path with its progress moved to the point nearest to the rover, never back and at most the window ahead."""
    stop = min(len(path.points), path.progress + int(window_m / STEP_M) + 1)
    ahead = path.points[path.progress : stop]
    nearest = int(((ahead[:, 0] - pose.north_m) ** 2 + (ahead[:, 1] - pose.east_m) ** 2).argmin())
    return ReferencePath(path.points, path.progress + nearest, path.speeds_m_s)


def rejoined(path: ReferencePath, here: NedPoint, evidence: EvidenceMap, half_width_m: float) -> ReferencePath:
    """The path with its progress moved on past a bend that the rover has left out; the same where it has left out none.

    A rover that plans motions cuts a bend, and one that makes way may come to the path's other end. The nearest place
    of the next metres counts if it is nearer than where the rover should be, and lies straight over seen ground.
    """
    off_m = here.distance_m(path.point(path.progress))
    ahead = path.points[path.progress : path.progress + round(REJOIN_M / STEP_M)]
    if off_m <= OFF_M:
        return path
    places_m = np.hypot(ahead[:, 0] - here.north_m, ahead[:, 1] - here.east_m)
    nearest = int(places_m.argmin())
    near_m = float(places_m[nearest])
    if near_m > off_m - NEARER_M:
        return path
    line = look_along(evidence, here, path.point(path.progress + nearest), half_width_m)
    if min(line.clear_m, line.seen_m) < near_m - 0.5 * evidence.evidence_m:
        return path
    return ReferencePath(path.points, path.progress + nearest, path.speeds_m_s)


def narrowest_ahead(
    path: ReferencePath, evidence: EvidenceMap, within_m: float, reach_m: float
) -> tuple[float, NedPoint]:
    """The place with the least room round it among the next ``within_m`` of the path, and that room, in metres.

    Room is looked for up to ``reach_m``. The place where the rover is does not count, but at the path's end.
    """
    first = min(path.progress + 1, len(path.points) - 1)
    stop = max(first + 1, min(path.progress + round(within_m / STEP_M), len(path.points) - 1) + 1)
    places = [path.point(i) for i in range(first, stop)]
    rooms_m = [clearance_m(evidence, place, reach_m) for place in places]
    return min(rooms_m), places[int(np.argmin(rooms_m))]


def with_planned_speeds(path: ReferencePath, planned: Path, resolution_m: float) -> ReferencePath:
    """The path with the speeds of its plan, each at its share of the whole length; unchanged without any."""
    if planned.curve is None or planned.speeds_fields_s is None or len(planned.speeds_fields_s) == 0:
        return path
    ends = np.cumsum(np.hypot(*np.diff(planned.curve, axis=0).T))
    shares = np.linspace(0.0, 1.0, len(path.points))
    pieces = np.searchsorted(ends / max(float(ends[-1]), 1e-9), shares, side="right")
    speeds = planned.speeds_fields_s[np.minimum(pieces, len(planned.speeds_fields_s) - 1)] * resolution_m
    return ReferencePath(path.points, path.progress, np.asarray(speeds, np.float64))


def _densified(corners: Points) -> Points:
    """Points ``STEP_M`` apart (at most) along the line through the corners, ends included."""
    if len(corners) == 1:
        return corners
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    wanted = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / STEP_M) + 1))
    return np.column_stack((np.interp(wanted, along, corners[:, 0]), np.interp(wanted, along, corners[:, 1])))
