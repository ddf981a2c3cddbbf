"""Whether a way leads to the targets that a companion has called unreachable: on the true ground, by a flood fill.

Nouns: true ways.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import GeoPoint, LocalFrame
from companion.core.grid import Grid
from companion.executive.mission_layout import MissionLayout
from companion.executive.mission_progress import TargetStatus
from companion.mapping.cost_to_go import cost_to_go
from companion.mapping.distance_field import distance_field
from sitl.lockstep import Drive
from sitl.scenario import Scenario
from sitl.world.doors import Door

FINEST_M = 0.05
MOST_CELLS = 1_000_000
ROUND_M = 3.0
"""So much free ground beyond world and targets counts, where the mission's grid has it."""
START_M = 0.5
"""The rover may start nearer to something than cells can tell: the free cell within this distance counts."""
Mask = NDArray[np.bool_]
Places = NDArray[np.float64]
"""Shape (n, 2): metres north and east, world frame."""


class Verdicts:
    """When which target was called unreachable. Of one drive; ``look`` is to be called a few times a second."""

    def __init__(self) -> None:
        self.began_s: float | None = None
        """When the rover moved first."""
        self.called_s: dict[int, float] = {}
        """By the target's number from 0; none that was tried again and reached."""

    def look(self, run: Drive) -> None:
        """At this moment."""
        now_s = run.simulator.time_s
        if self.began_s is None and run.simulator.driven_m > 0.0:
            self.began_s = now_s
        for number, (_, status) in enumerate(run.companion.statuses()):
            if status is not TargetStatus.UNREACHABLE:
                self.called_s.pop(number, None)
            else:
                self.called_s.setdefault(number, now_s)

    def wrong(self, run: Drive) -> int:
        """How many targets are called unreachable at the end though a way leads there (``leads_to``)."""
        self.look(run)
        executor, wrong = run.companion.executor, 0
        if executor is None:
            return 0
        for number, called_s in self.called_s.items():
            doors = ((called_s if self.began_s is None else self.began_s), called_s, run.time_limit_s)
            point = LocalFrame(executor.layout.origin).to_geo(executor.progress.targets[number].point)
            wrong += leads_to(point, run.scenario, executor.layout, doors)
        return wrong


def leads_to(target: GeoPoint, scenario: Scenario, layout: MissionLayout, moments: tuple[float, float, float]) -> bool:
    """Whether a way leads from the rover's start to a target, on which it has half its width free at each side.

    Cells count as narrower than they are: what is called a way is one. The mission's and the autopilot's fences close
    whole fields, as docs/missions.md says. ``moments``: see ``is_passed``; what could move and stands then stands.
    """
    base, start = layout.evidence.base, scenario.start
    origin_m = np.array(start.place_of(layout.origin))
    ends = np.array([start.place_of(target), (start.north_m, start.east_m)])
    low, size_m = _extent(scenario, base, origin_m, ends)
    side_m = max(FINEST_M, math.sqrt(float(size_m.prod()) / MOST_CELLS))
    count = np.maximum(np.ceil(size_m / side_m).astype(int), 1)
    solid = _solid(scenario, low, side_m, count, moments)
    half_width_m = scenario.outline.radius_m or scenario.outline.half_width_m
    # The middle of a cell, and what it stands for, are up to this far from each other.
    free = (distance_field(solid) - math.sqrt(2.0)) * side_m >= half_width_m
    free &= ~_closed(layout, base, low - origin_m, side_m, count)
    (goal_y, goal_x), at = ((ends - low) / side_m).astype(int)
    if not (0 <= goal_y < count[0] and 0 <= goal_x < count[1] and free[goal_y, goal_x]):
        return False
    times = cost_to_go(np.where(free, 1.0, np.inf), np.array([[goal_x, goal_y]]))
    reach = math.ceil(START_M / side_m)
    round_start = times[max(at[0] - reach, 0) : at[0] + reach + 1, max(at[1] - reach, 0) : at[1] + reach + 1]
    return bool(np.isfinite(round_start).any())


def is_passed(door: Door, moments: tuple[float, float, float]) -> bool:
    """Whether a door counts as open: it is when the target is called unreachable, or it opens again and again.

    ``moments``: when the rover began to drive, when the target was called, and the run's time limit.
    """
    began_s, called_s, limit_s = moments
    was_open = door.is_open(began_s) or door.next_change_s(began_s) <= called_s
    return door.is_open(called_s) or (was_open and door.next_change_s(called_s) <= limit_s)


def _extent(scenario: Scenario, base: Grid, origin_m: Places, ends: Places) -> tuple[Places, Places]:
    """South-west corner and size of the ground that counts: world and ends, as far as the mission's grid reaches."""
    world, corner = scenario.world, np.array([base.south_west.north_m, base.south_west.east_m]) + origin_m
    spanned = np.array([[world.south_m, world.west_m],
                        [world.south_m + world.height_m, world.west_m + world.width_m], *ends])  # fmt: skip
    low = np.maximum(spanned.min(axis=0) - ROUND_M, corner)
    high = np.minimum(spanned.max(axis=0) + ROUND_M, corner + base.resolution_m * np.array([base.height, base.width]))
    return low, np.maximum(high - low, FINEST_M)


def _middles(low: float, side_m: float, count: int) -> Places:
    return low + (np.arange(count, dtype=np.float64) + 0.5) * side_m


def _solid(
    scenario: Scenario, low: Places, side_m: float, count: NDArray[np.int64], moments: tuple[float, float, float]
) -> Mask:
    world, called_s = scenario.world, moments[1]
    fields = world.obstacles.copy()
    for door in world.doors:
        fields |= door.fields & (not is_passed(door, moments))
    north_m, east_m = (_middles(low[axis], side_m, count[axis]) for axis in (0, 1))
    solid = _taken(fields, (north_m - world.south_m) / world.resolution_m, (east_m - world.west_m) / world.resolution_m)
    for number, mover in enumerate(world.movers):
        at_n, at_e, *velocity = world.mover_at(number, called_s)
        if not any(velocity):
            solid |= np.hypot(north_m[:, None] - at_n, east_m[None, :] - at_e) <= mover.radius_m
    return solid


def _closed(layout: MissionLayout, base: Grid, low: Places, side_m: float, count: NDArray[np.int64]) -> Mask:
    """``low``: in the local frame."""
    closed = np.zeros((base.height, base.width), np.bool_)
    for bound in layout.bounds:
        closed |= bound.closed(base)
    corner = base.south_west.north_m, base.south_west.east_m
    north, east = (
        (_middles(low[axis], side_m, count[axis]) - corner[axis]) / base.resolution_m for axis in (0, 1)
    )  # fmt: skip
    return _taken(closed, north, east)


def _taken(fields: Mask, rows: Places, columns: Places) -> Mask:
    """The fields at these places, which are given in fields; False beyond them."""
    y, x = np.floor(rows).astype(int), np.floor(columns).astype(int)
    inside = ((y >= 0) & (y < fields.shape[0]))[:, None] & ((x >= 0) & (x < fields.shape[1]))[None, :]
    taken: Mask = inside & fields[np.clip(y, 0, fields.shape[0] - 1)[:, None], np.clip(x, 0, fields.shape[1] - 1)]
    return taken
