"""A resumed run: whose the rover is, and where its mission and its map lie."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.checkpoint.resume import (
    PreviousRun,
    ResumePermission,
    grid_shift,
    resume_permission,
    resumed_layout,
    resumed_nav_state,
)
from companion.checkpoint.state_format import SavedGrid, SavedNavState, SavedPlace, SavedProgress
from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.core.grid import Cell
from companion.executive.mission_layout import lay
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mission.mission import Mission
from companion.safety.mode_latch import Control
from companion.settings import MappingSettings
from companion.vehicle.events import GuardSeen, HeartbeatSeen, LocalPositionSeen, RoverMode
from companion.vehicle.state import VehicleState
from tests.support.rig import yard
from tests.support.states import a_state

GUIDED, HOLD, MANUAL = RoverMode.GUIDED, RoverMode.HOLD, RoverMode.MANUAL
OURS, FREE, THEIRS = Control.COMPANION, Control.NOBODY, Control.PERSON


def found(mode: int, armed: bool, boot_s: float) -> VehicleState:
    position = LocalPositionSeen(boot_s + 0.1, boot_s, 0.0, 0.0, 0.0, 0.0)
    return VehicleState(heartbeat=HeartbeatSeen(boot_s, mode, armed, 1), position=position)


@pytest.mark.parametrize(
    ("control", "released", "mode", "armed", "restarted", "owner", "may_arm"),
    [
        (OURS, False, GUIDED, True, False, FREE, False),
        (OURS, False, GUIDED, False, False, FREE, False),
        (OURS, False, HOLD, True, False, THEIRS, False),
        (OURS, False, HOLD, False, False, THEIRS, False),
        (OURS, False, MANUAL, True, True, THEIRS, False),
        (OURS, False, MANUAL, False, True, FREE, True),
        (OURS, False, GUIDED, False, True, FREE, True),
        (OURS, True, HOLD, True, False, FREE, True),
        (OURS, True, HOLD, True, True, THEIRS, False),
        (OURS, True, HOLD, False, True, THEIRS, False),
        (OURS, True, HOLD, False, False, THEIRS, False),
        (OURS, True, MANUAL, True, False, THEIRS, False),
        (OURS, True, MANUAL, False, False, THEIRS, False),
        (OURS, True, GUIDED, True, False, THEIRS, False),
        (THEIRS, False, MANUAL, True, False, THEIRS, False),
        (THEIRS, False, HOLD, False, True, THEIRS, False),
        (THEIRS, True, GUIDED, True, False, THEIRS, False),
    ],
)
def test_whose_the_rover_is(
    control: Control, released: bool, mode: int, armed: bool, restarted: bool, owner: Control, may_arm: bool
) -> None:
    state = a_state(control=control, released=released, boot_s=60.0)
    assert resume_permission(state, found(mode, armed, 20.0 if restarted else 65.0)) == ResumePermission(owner, may_arm)


@pytest.mark.parametrize(
    ("mode", "acted", "released", "owner"),
    [
        (HOLD, True, False, FREE),
        (HOLD, False, False, THEIRS),
        (MANUAL, False, False, THEIRS),
        (GUIDED, False, False, FREE),
        (HOLD, True, True, FREE),
    ],
)
def test_hold_that_the_guard_put_is_nobodys(mode: int, acted: bool, released: bool, owner: Control) -> None:
    state = a_state(control=OURS, released=released, boot_s=60.0, guarded=True)
    rover = replace(found(mode, True, 65.0), guard=GuardSeen(65.0, 0.3, acted))
    permission = resume_permission(state, rover)
    assert permission is not None and permission.control is owner


def test_where_a_guard_was_it_is_waited_for_before_hold_is_taken_for_a_persons() -> None:
    state = a_state(control=OURS, released=False, boot_s=60.0, guarded=True)
    assert resume_permission(state, found(HOLD, True, 65.0)) is None
    assert resume_permission(state, found(MANUAL, True, 65.0)) == ResumePermission(THEIRS, False)


def test_nothing_is_said_of_a_rover_that_has_hardly_been_heard() -> None:
    assert resume_permission(a_state(), VehicleState()) is None
    assert resume_permission(a_state(), VehicleState(heartbeat=HeartbeatSeen(1.0, GUIDED, True, 1))) is None


HOME = GeoPoint(53.1327, 23.169)
ORIGIN = GeoPoint(53.1326, 23.1689)


def previous_run(folder: Path, origin: GeoPoint = ORIGIN) -> tuple[PreviousRun, Mission]:
    """A state of the yard with something on its map."""
    frame = LocalFrame(origin)
    home = frame.to_ned(HOME)
    mission = yard(folder)
    layout = lay(mission, MappingSettings(), origin, HOME, Pose(home.north_m, home.east_m, 0.0, 0.0))
    base = layout.evidence.base
    corner = base.south_west
    state = a_state(
        origin=(origin.lat_deg, origin.lon_deg),
        home=(HOME.lat_deg, HOME.lon_deg),
        progress=SavedProgress(
            start=SavedPlace(north_m=home.north_m, east_m=home.east_m),
            statuses=(TargetStatus.UNREACHABLE,),
            index=0,
            phase=MissionPhase.WAIT,
            left_s=2.0,
            give_up_left_s=100.0,
        ),
        ground=SavedGrid(
            north_m=corner.north_m - home.north_m,
            east_m=corner.east_m - home.east_m,
            resolution_m=1.0,
            width=base.width,
            height=base.height,
            subdivisions=layout.evidence.subdivisions,
        ),
    )
    log_odds, penalty = np.zeros_like(layout.evidence.log_odds), np.zeros_like(layout.evidence.penalty)
    log_odds[10:20, 30:34], log_odds[20:60, 30:34], log_odds[60, 60] = 3.0, -1.2, 0.9
    penalty[3, 3] = 0.15
    return PreviousRun(state, {"log_odds": log_odds, "penalty": penalty}), mission


def test_in_the_same_frame_the_map_is_what_it_was(tmp_path: Path) -> None:
    previous, mission = previous_run(tmp_path)
    layout, progress, said = resumed_layout(previous, mission, MappingSettings(), ORIGIN, 500.0, same=True)
    assert np.array_equal(layout.evidence.log_odds, previous.rasters["log_odds"])
    assert np.array_equal(layout.evidence.penalty, previous.rasters["penalty"])
    assert layout.evidence.grid.weights[1, 3] >= 1.0, "and the fields know it"
    assert said == "with its map"
    assert (progress.phase, progress.until_s, progress.give_up_s) == (MissionPhase.WAIT, 502.0, 600.0)
    assert progress.statuses == (TargetStatus.UNREACHABLE,)
    home = LocalFrame(ORIGIN).to_ned(HOME)
    assert progress.home.point.distance_m(home) < 1e-6 and progress.goal.cell == Cell(15, 7)


@pytest.mark.parametrize(("north_m", "east_m", "same"), [(0.0, 0.0, False), (7.3, -4.1, True), (-3.0, 2.0, False)])
def test_in_a_frame_that_may_be_another_only_obstacles_count_and_lie_on_the_same_ground(
    tmp_path: Path, north_m: float, east_m: float, same: bool
) -> None:
    previous, mission = previous_run(tmp_path)
    origin = LocalFrame(ORIGIN).to_geo(NedPoint(north_m, east_m))
    layout, _, said = resumed_layout(previous, mission, MappingSettings(), origin, 0.0, same=same)
    settings, log_odds = MappingSettings(), layout.evidence.log_odds
    assert (log_odds >= 0.0).all(), "no ground counts as seen"
    assert np.array_equal(log_odds > 0.0, previous.rasters["log_odds"] > 0.0)
    assert log_odds.max() < settings.sure_at, "and an obstacle may be doubted"
    assert not layout.evidence.penalty.any()
    assert "obstacles" in said
    corner = layout.evidence.base.south_west
    before = resumed_layout(previous, mission, MappingSettings(), ORIGIN, 0.0, same=True)[0].evidence.base.south_west
    assert corner.distance_m(NedPoint(before.north_m - north_m, before.east_m - east_m)) < 0.01


def test_a_grid_that_has_become_a_field_larger_takes_the_map_along(tmp_path: Path) -> None:
    previous, mission = previous_run(tmp_path)
    ground = previous.state.ground.model_copy(
        update={"east_m": previous.state.ground.east_m + 2.0, "north_m": previous.state.ground.north_m - 1.0}
    )
    moved = PreviousRun(previous.state.model_copy(update={"ground": ground}), previous.rasters)
    layout, _, _ = resumed_layout(moved, mission, MappingSettings(), ORIGIN, 0.0, same=True)
    assert grid_shift(moved.state, layout) == Cell(2, -1)
    s = layout.evidence.subdivisions
    assert np.array_equal(layout.evidence.log_odds[:-s, 2 * s :], previous.rasters["log_odds"][s:, : -2 * s])
    assert not layout.evidence.log_odds[:, : 2 * s].any()
    saved = SavedNavState(past=((4, 4), (5, 4)), returning=True, until_search=2, since_better=1, draws=9, doubts_left=1)
    assert resumed_nav_state(saved, grid_shift(moved.state, layout)).past == (Cell(6, 3), Cell(7, 3))


def test_other_settings_of_the_map_cost_the_map_and_not_the_progress(tmp_path: Path) -> None:
    previous, mission = previous_run(tmp_path)
    layout, progress, said = resumed_layout(previous, mission, MappingSettings(evidence_m=0.5), ORIGIN, 0.0, same=True)
    assert not layout.evidence.log_odds.any() and "without its map" in said
    assert progress.statuses == (TargetStatus.UNREACHABLE,)
