"""Resumes an interrupted run: who controls the rover now, and mission, progress and map in the present frame.

Nouns: interrupted run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from companion.checkpoint.state_format import (
    Raster,
    SavedCommands,
    SavedEstimate,
    SavedGenerator,
    SavedNavState,
    SavedPlace,
    SavedState,
)
from companion.control.following import Following
from companion.control.model_estimate import ModelEstimate, bounded
from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.core.grid import Cell
from companion.executive.command_progress import START, CommandProgress, CommandTally, OpenCommand
from companion.executive.goal_driver import Tally
from companion.executive.laps import LapStart
from companion.executive.mission_executor import ORIGIN_MOVED_M, MissionExecutor
from companion.executive.mission_layout import MissionLayout, apart_m, from_home, lay
from companion.executive.mission_progress import MissionPhase, MissionProgress
from companion.mapping.map_edits import restore, shifted
from companion.mission.autopilot_fence import NO_FENCE, AutopilotFence
from companion.mission.do_commands import DoCommand
from companion.mission.mission import Mission, OnBlocked, Patrol
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import NavState
from companion.safety.mode_latch import Control
from companion.settings import MappingSettings
from companion.vehicle.events import LocalPositionSeen, RoverMode
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState

SAME_BOOT_S = 1.0
"""The difference of two clocks that keep running changes by no more than this (link delays)."""
CARRIED_M = 25.0
"""A rover found farther than this from its last field was carried: its leg begins again where it stands."""


@dataclass(frozen=True, eq=False, slots=True)
class PreviousRun:
    """What an interrupted run saved: its state and the rasters of its map, ``log_odds`` and ``penalty``."""

    state: SavedState
    rasters: Mapping[str, Raster]

    @property
    def sticks(self) -> Sticks:
        """Rest position of the sticks if the program had control: a person who has moved them since takes over."""
        return Sticks(self.state.sticks_us if self.state.control is Control.COMPANION else None)


@dataclass(frozen=True, slots=True)
class ResumePermission:
    """What a resumed run may do. ``control``: PERSON if a person has taken the rover since."""

    control: Control
    may_arm: bool


def clock_ahead_s(position: LocalPositionSeen) -> float:
    """How far the program's clock is ahead of the autopilot's time since boot."""
    return position.time_s - position.boot_s


def same_boot(state: SavedState, position: LocalPositionSeen) -> bool:
    """Whether neither the autopilot nor the computer has restarted since."""
    return abs(clock_ahead_s(position) - state.ahead_s) <= SAME_BOOT_S


def resume_permission(state: SavedState, vehicle: VehicleState) -> ResumePermission | None:
    """Who controls the rover now, and whether it may be armed; None until heartbeat and position are known.

    - A person who had control keeps it over any restart, until somebody sets GUIDED.
    - If the program had control and the rover has left GUIDED since, a person has taken it, unless the autopilot has
      restarted.
    - A rover that was disarmed since, without a restart, is not armed again.
    - HOLD that the guard on the autopilot put, because the program had fallen silent, is nobody's.
    - If the program had stopped the rover in HOLD, it continues only if mode, arming and boot are unchanged: otherwise
      a person may have driven it, switched it off or moved it.
    """
    heartbeat, position = vehicle.heartbeat, vehicle.position
    if heartbeat is None or position is None:
        return None
    if state.control is Control.PERSON:
        return ResumePermission(Control.PERSON, may_arm=False)
    restarted = position.boot_s < state.boot_s
    if state.released:
        unchanged = heartbeat.mode == RoverMode.HOLD and heartbeat.armed == state.armed and not restarted
        control = Control.NOBODY if unchanged else Control.PERSON
        return ResumePermission(control, may_arm=unchanged and state.armed)
    if heartbeat.mode == RoverMode.HOLD and heartbeat.armed and not restarted and state.guarded:
        if vehicle.guard is None:
            return None  # it speaks twice a second
        if vehicle.guard.acted:
            return ResumePermission(Control.NOBODY, may_arm=False)
    if heartbeat.mode != RoverMode.GUIDED and (heartbeat.armed or not restarted):
        return ResumePermission(Control.PERSON, may_arm=False)
    return ResumePermission(Control.NOBODY, may_arm=restarted)


def resumed_layout(
    previous: PreviousRun,
    mission: Mission,
    settings: MappingSettings,
    origin: GeoPoint,
    now_s: float,
    *,
    same: bool,
    fence: AutopilotFence = NO_FENCE,
    narrow_sight: bool = False,
) -> tuple[MissionLayout, MissionProgress, str]:
    """The mission in the present frame with the saved map, the saved progress, and a text about the map for people.

    ``same``: the autopilot has not restarted, so its frame is the same unless its origin has moved. Otherwise a new
    position estimate may be some metres off: no ground counts as seen free, and obstacles keep the least evidence that
    still makes them obstacles.
    Raises MissionError.
    """
    state, saved_origin = previous.state, GeoPoint(*previous.state.origin)
    start = _in_frame(state.progress.start, saved_origin, origin)
    start_pose = Pose(start.north_m, start.east_m, 0.0, now_s)
    home = GeoPoint(*state.home)
    layout = lay(mission, settings, origin, home, start_pose, fence, narrow_sight=narrow_sight)
    progress = _progress(layout, state, saved_origin, now_s, mission.patrol, mission.commands)
    evidence, shift = layout.evidence, grid_shift(state, layout)
    if evidence.subdivisions != state.ground.subdivisions or evidence.base.resolution_m != state.ground.resolution_m:
        return layout, progress, "without its map (the settings of the map have changed)"
    same = same and apart_m(origin, saved_origin) <= ORIGIN_MOVED_M
    cell_shift = Cell(shift.x * evidence.subdivisions, shift.y * evidence.subdivisions)
    log_odds = shifted(previous.rasters["log_odds"], evidence.log_odds.shape, cell_shift)
    penalty = shifted(previous.rasters["penalty"], evidence.penalty.shape, shift)
    restore(evidence, log_odds, penalty if same else np.zeros_like(penalty), obstacles_alone=not same)
    text = "with its map" if same else "with the obstacles of its map: what was free is looked at anew"
    return layout, progress, text


def resume_mission(previous: PreviousRun, executor: MissionExecutor, vehicle: VehicleState, now_s: float) -> None:
    """Continue in the middle of a leg: counts, random generator, trail, and the navigator's state.

    The leg begins again if the rover was carried, or if the mission does not drive now.
    """
    state = previous.state
    tally = Tally(state.tally.steps, state.tally.return_steps, state.tally.stuck)
    executor.driver.go_on(tally, state.tally.epoch)
    if state.draws is not None:
        executor.driver.searcher.rng.bit_generator.state = _numpy_state(state.draws)
    executor.resume_commands()
    executor.lap_start = LapStart(now_s - state.lap.elapsed_s, -state.lap.driven_m, state.lap.failed_before)
    if state.estimate is not None:
        executor.estimator.go_on(resumed_estimate(state.estimate))
    executor.range_ages.go_on(state.range_ages)
    shift = grid_shift(state, executor.layout)
    for x, y in state.trail:
        executor.trail.enter(Cell(x + shift.x, y + shift.y))
    _map_newest_scan(executor, vehicle)
    progress, saved, pose = executor.progress, state.nav_state, vehicle.pose_at(now_s)
    drives = progress.phase in (MissionPhase.TRAVEL, MissionPhase.HOME) and not executor.target_refused
    if saved is not None and pose is not None and drives:
        nav_state = resumed_nav_state(saved, shift)
        if executor.evidence.base.centre_of(nav_state.past[-1]).distance_m(pose.point) <= CARRIED_M:
            executor.driver.take_up(progress.goal, nav_state, saved.doubts_left, executor.view(vehicle, now_s))


def grid_shift(state: SavedState, layout: MissionLayout) -> Cell:
    """The offset between the saved grid and the present one: the saved field f is now f + shift.

    Home is in the middle of a field in both grids; but a grid around places in degrees may be a field larger in another
    frame.
    """
    corner, resolution_m = from_home(layout), layout.evidence.base.resolution_m
    east, north = state.ground.east_m - corner.east_m, state.ground.north_m - corner.north_m
    return Cell(round(east / resolution_m), round(north / resolution_m))


def resumed_estimate(saved: SavedEstimate) -> ModelEstimate:
    """How the rover follows velocities, as the earlier run had found."""
    began, figures = (Following(**one.model_dump()) for one in (saved.began, saved.figures))
    return ModelEstimate(
        began, bounded(figures, began), saved.gathered_s, saved.braked_s, saved.turned_s, saved.steady_s
    )


def resumed_nav_state(saved: SavedNavState, shift: Cell) -> NavState:
    """The navigator's state in fields of the present grid. The driver sets its target; the path is planned again."""
    return NavState(
        target=Cell(0, 0),
        past=tuple(Cell(x + shift.x, y + shift.y) for x, y in saved.past),
        returning=saved.returning,
        until_search=saved.until_search,
        since_better=saved.since_better,
        draws=saved.draws,
    )


def _progress(
    layout: MissionLayout,
    state: SavedState,
    saved_origin: GeoPoint,
    now_s: float,
    patrol: Patrol | None,
    commands: tuple[DoCommand, ...],
) -> MissionProgress:
    """The saved progress, with the targets in the present frame."""
    saved, requested = state.progress, None
    if saved.requested is not None:
        point = _in_frame(saved.requested, saved_origin, layout.origin)
        cell = layout.evidence.base.cell_at(point)
        requested = ResolvedTarget(saved.requested.name, point, cell, 0.0, OnBlocked.SKIP, saved.requested.speed_m_s)
    mission_commands = {place: target.commands for place, target in enumerate(layout.targets)} | {START: commands}
    return MissionProgress(
        layout.targets,
        replace(layout.start, name=saved.start.name),
        saved.statuses,
        index=saved.index,
        phase=saved.phase,
        until_s=now_s + saved.left_s,
        give_up_s=None if saved.give_up_left_s is None else now_s + saved.give_up_left_s,
        requested=requested,
        commands=_commands(
            state.commands, mission_commands, now_s, lambda place: _in_frame(place, saved_origin, layout.origin)
        ),
        patrol=patrol,
        lap=state.lap.number,
        missed=state.lap.missed,
    )


def _commands(
    saved: SavedCommands,
    commands: Mapping[int, tuple[DoCommand, ...]],
    now_s: float,
    placed: Callable[[SavedPlace], NedPoint],
) -> CommandProgress:
    """How far the commands of the mission are; what is not in the mission was never asked for.

    ``placed``: where a saved place lies now.
    """
    opened = tuple(
        OpenCommand(
            one.place,
            one.number,
            commands[one.place][one.number],
            None if one.left_s is None else now_s + one.left_s,
            one.on_way,
            one.announced,
            None if one.at is None else placed(one.at),
        )
        for one in saved.open
        if one.number < len(commands.get(one.place, ()))
    )
    tallies = tuple(
        CommandTally(one.place, one.number, one.counts, one.answer)
        for one in saved.tallies
        if one.number < len(commands.get(one.place, ()))
    )
    return CommandProgress(opened, tallies)


def _in_frame(place: SavedPlace, saved_origin: GeoPoint, origin: GeoPoint) -> NedPoint:
    """A saved place in the present frame."""
    return LocalFrame(origin).to_ned(LocalFrame(saved_origin).to_geo(NedPoint(place.north_m, place.east_m)))


def _map_newest_scan(executor: MissionExecutor, vehicle: VehicleState) -> None:
    """A rover that still moves is beyond the ground seen when the state was saved: a scan must come first."""
    seen, attitude = vehicle.scan_ahead, vehicle.attitude
    pose = None if seen is None else vehicle.pose_at(vehicle.seen_s(seen))
    if seen is not None and attitude is not None and pose is not None:
        executor.map_scan(pose, attitude.yaw_rate_rad_s, seen.scan)


def _numpy_state(draws: SavedGenerator) -> dict[str, Any]:
    inner = {"state": draws.state, "inc": draws.inc}
    return {"bit_generator": "PCG64", "state": inner, "has_uint32": draws.has_uint32, "uinteger": draws.uinteger}
