"""Taking up a run that has been interrupted: whose rover it is now, and where the mission, its progress and its map lie now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.checkpoint.model import SavedLeg, SavedPlace, SavedState
from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.core.grid import Cell
from companion.executive.mission_layout import MissionLayout, apart_m, from_home, lay
from companion.executive.mission_progress import MissionProgress
from companion.mapping.evidence_map import restore
from companion.mission.fence import NO_FENCE, AutopilotFence
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import NavState
from companion.safety.mode_latch import Control
from companion.settings import MappingSettings
from companion.vehicle.events.vehicle import LocalPositionSeen, RoverMode
from companion.vehicle.state import VehicleState

SAME_CLOCKS_S = 1.0
"""Two clocks that have both gone on differ by no more than this from what they differed by: a link's delays."""
SAME_ORIGIN_M = 0.2

Raster = NDArray[np.float32]


@dataclass(frozen=True, eq=False, slots=True)
class Kept:
    """What an earlier run has left: its state and its map, ``log_odds`` and ``penalty``."""

    state: SavedState
    rasters: Mapping[str, Raster]


@dataclass(frozen=True, slots=True)
class Ownership:
    """Whether a person has taken the rover since, and whether it may be armed by us."""

    control: Control
    may_arm: bool


def clock_ahead_s(position: LocalPositionSeen) -> float:
    """By how much our clock is ahead of the autopilot's."""
    return position.time_s - position.boot_s


def same_boot(state: SavedState, position: LocalPositionSeen) -> bool:
    """Whether autopilot and computer have both been on all the time since."""
    return abs(clock_ahead_s(position) - state.ahead_s) <= SAME_CLOCKS_S


def ownership(state: SavedState, vehicle: VehicleState) -> Ownership | None:
    """Whose the rover is that an earlier run left behind; None while too little has been heard.

    A rover that a person had taken stays with that person, over any restart, until somebody sets GUIDED. One that was ours and that has left GUIDED
    without us was taken meanwhile, unless its autopilot has restarted; and one that has been disarmed without us is not armed. One that we have
    stopped in HOLD ourselves waits there for us only as we have left it: a person may have driven it, switched it off, put it away.
    """
    heartbeat, position = vehicle.heartbeat, vehicle.position
    if heartbeat is None or position is None:
        return None
    if state.control is Control.PERSON:
        return Ownership(Control.PERSON, may_arm=False)
    restarted = position.boot_s < state.boot_s
    if state.released:
        as_left = heartbeat.mode == RoverMode.HOLD and heartbeat.armed == state.armed and not restarted
        return Ownership(Control.NOBODY if as_left else Control.PERSON, may_arm=as_left and state.armed)
    if heartbeat.mode != RoverMode.GUIDED and (heartbeat.armed or not restarted):
        return Ownership(Control.PERSON, may_arm=False)
    return Ownership(Control.NOBODY, may_arm=restarted)


def lay_resumed(
    kept: Kept,
    mission: Mission,
    settings: MappingSettings,
    origin: GeoPoint,
    now_s: float,
    *,
    same: bool,
    fence: AutopilotFence = NO_FENCE,
) -> tuple[MissionLayout, MissionProgress, str]:
    """The mission where it lies now with the map of then, the progress, and what is to be said of the map.

    ``same``: the autopilot has been on since, so that its frame is the one of then unless its origin has moved. Otherwise a new estimate may put
    everything some metres elsewhere: no ground counts as seen free, and obstacles as such that have hardly been seen. Raises MissionError.
    """
    state, then = kept.state, GeoPoint(*kept.state.origin)
    start = _now_at(state.progress.start, then, origin)
    began_at = Pose(start.north_m, start.east_m, 0.0, now_s)
    layout = lay(mission, settings, origin, GeoPoint(*state.home), began_at, fence)
    progress = _progress(layout, state, then, now_s)
    evidence, shift = layout.evidence, shift_of(state, layout)
    if evidence.subdivisions != state.ground.subdivisions or evidence.base.resolution_m != state.ground.resolution_m:
        return layout, progress, "without its map (the settings of the map have changed)"
    same = same and apart_m(origin, then) <= SAME_ORIGIN_M
    fine = Cell(shift.x * evidence.subdivisions, shift.y * evidence.subdivisions)
    log_odds = _moved(kept.rasters["log_odds"], evidence.log_odds.shape, fine)
    penalty = _moved(kept.rasters["penalty"], evidence.penalty.shape, shift)
    if not same:
        log_odds = np.where(log_odds >= settings.occupied_at, np.float32(settings.occupied_at), np.float32(0.0))
        penalty = np.zeros_like(penalty)
    restore(evidence, log_odds, penalty)
    said = "with its map" if same else "with the obstacles of its map: what was free is looked at anew"
    return layout, progress, said


def shift_of(state: SavedState, layout: MissionLayout) -> Cell:
    """By how many fields the grid's corner lies elsewhere from home than it did: what was field f is now f + shift.

    Home is in the middle of a field of either grid; but a grid that is laid round places in degrees may be a field larger in another frame.
    """
    corner, resolution_m = from_home(layout).south_west, layout.evidence.base.resolution_m
    east, north = state.ground.east_m - corner.east_m, state.ground.north_m - corner.north_m
    return Cell(round(east / resolution_m), round(north / resolution_m))


def nav_state(leg: SavedLeg, shift: Cell) -> NavState:
    """The navigator's memory in the fields of now; its target is still to be put in, and its path is planned anew."""
    return NavState(
        target=Cell(0, 0),
        past=tuple(Cell(x + shift.x, y + shift.y) for x, y in leg.past),
        returning=leg.returning,
        until_search=leg.until_search,
        since_better=leg.since_better,
        draws=leg.draws,
    )


def _progress(layout: MissionLayout, state: SavedState, then: GeoPoint, now_s: float) -> MissionProgress:
    """How far the mission had come, on the targets where they lie now."""
    saved, requested = state.progress, None
    if saved.errand is not None:
        point = _now_at(saved.errand, then, layout.origin)
        cell = layout.evidence.base.cell_at(point)
        requested = ResolvedTarget(saved.errand.name, point, cell, 0.0, OnBlocked.SKIP, saved.errand.speed_m_s)
    return MissionProgress(
        layout.targets,
        replace(layout.start, name=saved.start.name),
        saved.statuses,
        index=saved.index,
        phase=saved.leg,
        until_s=now_s + saved.left_s,
        give_up_s=None if saved.give_up_left_s is None else now_s + saved.give_up_left_s,
        requested=requested,
    )


def _now_at(place: SavedPlace, then: GeoPoint, origin: GeoPoint) -> NedPoint:
    """A place of the frame of then, in the frame of now."""
    return LocalFrame(origin).to_ned(LocalFrame(then).to_geo(NedPoint(place.north_m, place.east_m)))


def _moved(raster: Raster, shape: tuple[int, ...], shift: Cell) -> Raster:
    """The raster on another one of this shape, this much farther east and north; zero where it says nothing."""
    result = np.zeros(shape, np.float32)
    height, width = shape
    y0, x0 = max(0, shift.y), max(0, shift.x)
    y1, x1 = min(height, raster.shape[0] + shift.y), min(width, raster.shape[1] + shift.x)
    if y0 < y1 and x0 < x1:
        result[y0:y1, x0:x1] = raster[y0 - shift.y : y1 - shift.y, x0 - shift.x : x1 - shift.x]
    return result
