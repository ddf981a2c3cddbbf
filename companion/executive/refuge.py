"""Where to go when the battery runs low: back the way the rover came, or to a rally point if the way there is shorter. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Cell
from companion.executive.trail import Trail
from companion.mapping.evidence_map import EvidenceMap
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.planning.planner import Planner
from companion.planning.problem import Budget, PlanningProblem

MOST_TRIED = 3
"""So many rally points, the nearest as the crow flies, are looked at."""


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
    """The places to try, one after the other: rally points with a way there that is shorter than the way back, then the start.

    The way back is the rover's own trail; where it does not lead to the start (the map was begun anew on the way), its length is taken
    for that of the straight line. The way to a rally point is the shortest on the map as known; one behind a border is none.
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
