"""The return path: the trail that the rover has left, and where to go when the battery runs low.

It goes back the way it came, or to a rally point if the way there is shorter.

Nouns: return path, trail, refuge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.mapping.evidence_map import EvidenceMap
from companion.mapping.map_queries import clearance_m
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import Steps, fields_between, is_clear
from companion.planning.planner import Planner
from companion.planning.problem import Budget, PlanningProblem

POINTS_M = 0.2
"""Places of the track are kept so far apart."""
TOUCH_M = 0.1
"""Evidence of what the rover passed may seem nearer than it was by so much."""
MOST_TRIED = 3
"""This many rally points, the nearest in a straight line, are looked at."""


class Trail:
    """The way that the rover has come since the mission began, without its loops.

    Fields from the first to the one the rover is in, each 8-adjacent to the one before, none of them twice.
    """

    def __init__(self) -> None:
        self._cells: list[Cell] = []
        self._places: dict[Cell, int] = {}
        self._points: dict[Cell, list[NedPoint]] = {}

    def enter(self, cell: Cell, point: NedPoint | None = None) -> None:
        """The rover is in this field now, at this place (None: not known any more, from an earlier run).

        Entering a field anew cuts off all that came after it.
        """
        if not self._cells or self._cells[-1] != cell:
            if self._cells:
                for between in fields_between(self._cells[-1], cell):
                    self._append(between)
            self._append(cell)
        if point is not None:
            points = self._points.setdefault(cell, [])
            if not points or points[-1].distance_m(point) >= POINTS_M:
                points.append(point)

    def carried(self, north_m: float, east_m: float, grid: Grid) -> Trail:
        """The same way on the ground, after the position has stepped by so much."""
        trail = Trail()
        for cell in self._cells:
            points = self._points.get(cell, [])
            for point in points or [grid.centre_of(cell)]:
                there = NedPoint(point.north_m + north_m, point.east_m + east_m)
                trail.enter(grid.cell_at(there), there if points else None)
        return trail

    def driven(self, evidence: EvidenceMap) -> Steps:
        """Steps of this way, either way, that the map bars although the track that the rover left there is clear on it.

        It passed beside what stands there, nearer than a rover could that stands in the middle of the field.
        """
        steps = {step for a, b in pairwise(self._cells) for step in ((a, b), (b, a))}
        barred = [step for step in steps if not is_clear(evidence.grid, step)]
        return frozenset(step for step in barred if all(self._is_clear(cell, evidence) for cell in step))

    def _is_clear(self, cell: Cell, evidence: EvidenceMap) -> bool:
        points, room_m = self._points.get(cell, []), evidence.rover_radius_m - TOUCH_M
        if not points or not evidence.base.contains(cell) or evidence.base.is_obstacle(cell):
            return False
        return all(clearance_m(evidence, point, room_m) >= room_m for point in points)

    def back(self) -> tuple[Cell, ...]:
        """From the field the rover is in to the first one."""
        return tuple(reversed(self._cells))

    @property
    def length_fields(self) -> float:
        """Length in fields; a diagonal step is sqrt 2."""
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(self._cells))

    def _append(self, cell: Cell) -> None:
        place = self._places.get(cell)
        if place is None:
            self._places[cell] = len(self._cells)
            self._cells.append(cell)
            return
        for gone in self._cells[place + 1 :]:
            del self._places[gone]
            self._points.pop(gone, None)
        del self._cells[place + 1 :]


@dataclass(frozen=True, slots=True)
class Refuge:
    """A place to return to. ``way``: fields from here to there that were driven before; empty: to be planned."""

    place: ResolvedTarget
    length_m: float
    way: tuple[Cell, ...] = ()


def refuges(
    start: ResolvedTarget,
    trail: Trail,
    rally: Sequence[NedPoint],
    here: NedPoint,
    evidence: EvidenceMap,
    planner: Planner,
) -> list[Refuge]:
    """The places to try, in order: rally points with a way there that is shorter than the way back, then the start.

    The way back is the rover's own trail; where it does not lead to the start (the map was begun anew on the way), the
    length of the straight line stands for it. The way to a rally point is the shortest on the known map; one behind a
    border is left out.
    """
    base = evidence.base
    way = trail.back()
    leads_back = len(way) > 0 and way[-1] == start.cell and way[0] == base.cell_at(here)
    length_m = trail.length_fields * base.resolution_m if leads_back else here.distance_m(start.point)
    back = Refuge(start, length_m, way if leads_back else ())
    numbered = sorted(enumerate(rally, start=1), key=lambda one: here.distance_m(one[1]))
    found = []
    for number, point in numbered[:MOST_TRIED]:
        cell = base.cell_at(point)
        if here.distance_m(point) >= length_m or base.is_obstacle(cell):
            continue
        to_there_m = _planned_m(evidence, planner, base.cell_at(here), cell)
        if to_there_m is not None and to_there_m < length_m:
            place = ResolvedTarget(f"rally point {number}", point, cell, 0.0, OnBlocked.HOLD, None)
            found.append(Refuge(place, to_there_m))
    return [*sorted(found, key=lambda refuge: refuge.length_m), back]


def _planned_m(evidence: EvidenceMap, planner: Planner, start: Cell, target: Cell) -> float | None:
    """Length of the shortest way on the map as known; None if there is none."""
    if start == target:
        return 0.0
    if not evidence.base.contains(start):
        return None
    weights = np.where(evidence.grid.weights >= OBSTACLE, OBSTACLE, 0.5)
    weights[start.y, start.x] = 0.5
    path = planner.plan(PlanningProblem(weights, start, target), Budget(), np.random.default_rng(0)).path
    return None if path is None else path.length_fields * evidence.base.resolution_m
