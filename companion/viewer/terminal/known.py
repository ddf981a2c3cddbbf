"""What a companion knows of its drive, as parts of a view: map, targets, path, what it does and why.

Places are moved by ``north_m``, ``east_m``: where the origin of the companion's local frame is shown.

Nouns: known layers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.app import Companion, Status
from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE
from companion.executive.mission_progress import MissionProgress, TargetStatus
from companion.mapping.evidence_map import EvidenceMap
from companion.navigation.field_step import Part
from companion.safety.reasons import RunPhase
from companion.viewer.frame import doing_of
from companion.viewer.headway import Headway
from companion.viewer.terminal.facts import Fact, Section
from companion.viewer.terminal.screen import Headline, Mood
from companion.viewer.terminal.sketch import Kind, Layer, Place, PlaceState

REACH_M = 300.0
STATES = {
    TargetStatus.PENDING: PlaceState.PENDING,
    TargetStatus.REACHED: PlaceState.REACHED,
    TargetStatus.UNREACHABLE: PlaceState.LOST,
    TargetStatus.SKIPPED: PlaceState.LOST,
}
PARTS = {Part.RETURN: "returning", Part.EXPLORE: "exploring", Part.SEARCH: "new path"}
MOODS = {"driving": Mood.GOOD, "connecting": Mood.WAITING, "waiting": Mood.WAITING, "stopped": Mood.BAD}


def known_layers(
    evidence: EvidenceMap, north_m: float = 0.0, east_m: float = 0.0, around: NedPoint | None = None
) -> tuple[Layer, ...]:
    """The companion's map, or what of it lies within ``REACH_M`` of a place. Takes a while: not for a tick."""
    base, s = evidence.base, evidence.subdivisions
    x, y, x_end, y_end = 0, 0, base.width, base.height
    if around is not None:
        here, reach = base.cell_at(around), math.ceil(base.fields(REACH_M))
        x, x_end = (min(max(edge, 0), base.width) for edge in (here.x - reach, here.x + reach + 1))
        y, y_end = (min(max(edge, 0), base.height) for edge in (here.y - reach, here.y + reach + 1))
    log_odds = evidence.log_odds[y * s : y_end * s, x * s : x_end * s]
    seen = (log_odds != 0.0).reshape(y_end - y, s, x_end - x, s).any(axis=(1, 3))
    closed = base.weights[y:y_end, x:x_end] >= OBSTACLE
    occupied = log_odds >= evidence.settings.occupied_at
    south_m = base.south_west.north_m + north_m + y * base.resolution_m
    west_m = base.south_west.east_m + east_m + x * base.resolution_m
    return (
        Layer(Kind.SEEN, seen, base.resolution_m, south_m, west_m),
        Layer(Kind.CLOSED, closed, base.resolution_m, south_m, west_m),
        Layer(Kind.WALL, occupied, evidence.evidence_m, south_m, west_m),
    )


def target_places(
    progress: MissionProgress, north_m: float = 0.0, east_m: float = 0.0, *, ended: bool = False
) -> tuple[Place, ...]:
    """The targets, and what has become of them; one that is tried again is not lost until the run has ended."""
    states = [STATES[status] for status in progress.statuses]
    if progress.tries_again and not ended:
        states[progress.index] = PlaceState.PENDING
    return tuple(
        Place(target.name, target.point.north_m + north_m, target.point.east_m + east_m, state)
        for target, state in zip(progress.targets, states, strict=True)
    )


def path_ahead(companion: Companion, north_m: float = 0.0, east_m: float = 0.0) -> NDArray[np.float64]:
    """The rest of the path that is followed, shape (n, 2), north and east."""
    path = None if companion.driver is None else companion.driver.path
    return np.empty((0, 2)) if path is None else path.points[path.progress :, :2] + (north_m, east_m)


def headline_of(companion: Companion, status: Status, headway: Headway | None = None) -> Headline:
    """In one line what is done, or why the rover stands and what it waits for; in the end, what it came to."""
    doing = doing_of(companion, status, headway)
    left = _left_m(companion, status) if status.activity.phase is RunPhase.DRIVING else None
    far = "" if left is None else f", {left:.0f} m straight"
    why = f", {doing['why']}" if doing["why"] else ""
    is_over = doing["state"] == "ended" and not doing["why"]
    came_to = f", {status.targets_reached} of {status.targets} targets reached" if is_over else ""
    return Headline(f"{doing['line']}{far}{why}{came_to}", MOODS.get(doing["state"], Mood.PLAIN))


def mission_section(companion: Companion, status: Status) -> Section:
    """Target and last decision."""
    decision, left = status.decision, _left_m(companion, status)
    far = "" if left is None else f", {left:.0f} m straight"
    searches = len(companion.driver.searcher.seconds) if companion.driver else 0
    facts = (
        Fact("target", f"{status.target or '-'}{far}"),
        Fact("reached", f"{status.targets_reached} of {status.targets}"),
        Fact("part", f"{decision.part.value}, {PARTS[decision.part]}" if decision else "-"),
        Fact("decided", decision.reason if decision else "-"),
        Fact("steps", f"{status.steps}, {searches} searches", minor=True),
    )
    return Section("Mission", facts)


def _left_m(companion: Companion, status: Status) -> float | None:
    """So far it is to the target; None without one."""
    goal = companion.progress.goal if companion.progress else None
    if goal is None or status.pose is None or not status.target:
        return None
    return status.pose.point.distance_m(goal.point)
