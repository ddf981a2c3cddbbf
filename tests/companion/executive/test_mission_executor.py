"""The mission executor: what there is to do in a tick, and that it alone writes the progress."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.core.frames import LocalFrame, NedPoint
from companion.core.grid import Cell
from companion.executive.mission_executor import ROLLS_OUT_S, STUCK_TOLD, MissionTask
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mission.autopilot_fence import AutopilotFence
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.safety.reasons import RunPhase
from companion.settings import Settings, parse_settings
from companion.vehicle.events import ParameterSeen
from companion.vehicle.state import fold
from tests.companion.safety.test_mode_latch import PLACE
from tests.support.desk import Desk
from tests.support.rig import GATE

STAYING = GATE + "hold_s = 5.0\n"


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    desk = Desk(tmp_path, STAYING)
    desk.begin()
    return desk


def step(desk: Desk, after_s: float = 0.05) -> MissionTask:
    """One tick later, the vehicle where it is."""
    desk.clock.time_s += after_s
    position = desk.run.vehicle.position
    assert position is not None
    desk.stand(position.north_m, position.east_m)
    task = desk.executor.decide(desk.run.vehicle, desk.now_s)
    if task is not MissionTask.END:
        desk.executor.guide(task, desk.executor.view(desk.run.vehicle, desk.now_s))
    return task


def test_a_leg_begins_once_and_a_stay_and_the_end_follow(desk: Desk) -> None:
    assert [step(desk), step(desk)] == [MissionTask.DRIVE] * 2 and desk.executor.phase is RunPhase.DRIVING
    assert desk.notices.texts == ["Heading for gate"]
    desk.at(desk.executor.progress.goal.point)
    assert step(desk) is MissionTask.DRIVE, "it is reached in this tick"
    assert desk.notices.texts[1:] == ["Reached gate"] and desk.executor.reached == 1
    assert step(desk) is MissionTask.STAND and desk.executor.phase is RunPhase.STAYING
    assert step(desk, 5.0) is MissionTask.END and desk.executor.progress.ended


def test_a_requested_goal_comes_first(desk: Desk) -> None:
    step(desk)
    goal = ResolvedTarget("requested goal 1", NedPoint(3.0, 0.0), Cell(2, 10), 0.0, OnBlocked.SKIP, None)
    desk.executor.request(goal)
    assert desk.executor.driver.goal is None, "the leg under way is left"
    step(desk)
    assert desk.executor.driver.goal == goal
    desk.at(goal.point)
    step(desk)
    step(desk)
    assert desk.executor.driver.goal == desk.executor.progress.targets[0]


def test_a_target_behind_the_fence_is_not_tried(desk: Desk) -> None:
    desk.executor.layout = replace(desk.executor.layout, refused={0: "gate lies behind the fence"})
    assert step(desk) is MissionTask.STAND
    assert desk.notices.texts == ["Refused: gate lies behind the fence"]
    assert desk.executor.progress.statuses == (TargetStatus.UNREACHABLE,)


def test_a_fence_that_changes_is_heeded_once(desk: Desk) -> None:
    desk.executor.heed_fence(AutopilotFence())
    assert desk.notices.told == []
    fence = AutopilotFence(circle_m=30.0, home=PLACE)
    desk.executor.heed_fence(fence)
    desk.executor.heed_fence(AutopilotFence(circle_m=30.0, home=PLACE))
    assert len(desk.notices.told) == 1 and desk.executor.layout.fence == fence
    assert len(desk.executor.layout.bounds) == 1


def test_a_low_battery_leads_back_the_way_it_came(desk: Desk) -> None:
    step(desk)
    desk.stand(2.0, 0.0)
    step(desk)
    pose = desk.run.vehicle.pose_at(desk.now_s)
    assert pose is not None
    desk.executor.go_back("battery at 12 %", [], pose)
    assert desk.executor.returning and desk.executor.progress.phase is MissionPhase.HOME
    step(desk)
    assert desk.notices.texts[-1] == "Heading for start"
    desk.stand(0.0, 0.0)
    step(desk)
    assert step(desk) is MissionTask.END and desk.executor.progress.statuses == (TargetStatus.SKIPPED,)


def test_the_way_back_is_laid_from_where_the_rover_comes_to_stand(desk: Desk) -> None:
    step(desk)
    desk.stand(2.0, 0.0)
    step(desk)
    pose = desk.run.vehicle.pose_at(desk.now_s)
    assert pose is not None
    desk.executor.go_back("battery at 12 %", [], pose)
    rolls(desk, 1.0)
    assert desk.executor.decide(desk.run.vehicle, desk.now_s) is MissionTask.STAND
    desk.clock.time_s += ROLLS_OUT_S
    rolls(desk, 0.2)
    assert desk.executor.decide(desk.run.vehicle, desk.now_s) is MissionTask.DRIVE, "a speed that is never zero"


def test_a_rover_that_goes_elsewhere_rolls_on(desk: Desk) -> None:
    step(desk)
    desk.stand(2.0, 0.0)
    step(desk)
    pose = desk.run.vehicle.pose_at(desk.now_s)
    assert pose is not None
    desk.executor.go_back("battery at 12 %", [], pose)
    goal = ResolvedTarget("requested goal 1", NedPoint(3.0, 0.0), Cell(2, 10), 0.0, OnBlocked.SKIP, None)
    desk.executor.request(goal)
    rolls(desk, 1.0)
    assert desk.executor.decide(desk.run.vehicle, desk.now_s) is MissionTask.DRIVE


def rolls(desk: Desk, north_m_s: float) -> None:
    position = desk.run.vehicle.position
    assert position is not None
    position = replace(position, time_s=desk.now_s, boot_s=desk.now_s, north_m_s=north_m_s)
    desk.run.vehicle = replace(desk.run.vehicle, position=position)


def test_a_map_is_forgotten_and_laid_out_anew_when_the_frame_moves(desk: Desk) -> None:
    executor, seen = desk.executor, desk.stand(0.0, 0.0)
    pose = seen.pose_at(desk.now_s)
    assert pose is not None and seen.scan is not None
    executor.map_scan(pose, 0.0, seen.scan.scan)
    assert executor.evidence.log_odds.any()
    executor.map_scan(pose, np.pi, replace(seen.scan.scan, range_m=np.full(90, 1.0)))
    assert not (executor.evidence.log_odds > 0.0).any(), "smeared by turning"
    executor.forget_map(desk.now_s)
    assert not executor.evidence.log_odds.any() and executor.maps_begun == 1
    executor.driver.go_on(replace(executor.driver.tally, stuck=2), 7)
    before = executor.progress.goal.point
    assert not executor.follow_origin(PLACE, desk.now_s)
    moved = LocalFrame(PLACE).to_geo(NedPoint(10.0, 0.0))
    assert executor.follow_origin(moved, desk.now_s) and executor.maps_begun == 2
    assert (executor.driver.tally.stuck, executor.driver.epoch) == (2, 7), "no leg draws the numbers of an earlier one"
    assert executor.progress.goal.point.distance_m(NedPoint(before.north_m - 10.0, before.east_m)) < 0.02


def test_settings_count_from_the_tick_after_they_were_replaced(desk: Desk) -> None:
    step(desk)
    desk.settings.replace(Settings.model_validate({"guidance": {"max_speed_m_s": 0.7}}))
    step(desk)
    assert desk.executor.view(desk.run.vehicle, desk.now_s).settings.guidance.max_speed_m_s == 0.7


@pytest.mark.parametrize(("controller", "most_m_s"), [("points", math.inf), ("motion-ga", 1.2)])
def test_planned_motions_keep_within_the_autopilots_limits(tmp_path: Path, controller: str, most_m_s: float) -> None:
    """Points are not told velocities along a path; their speed is told to the autopilot."""
    desk = Desk(tmp_path, STAYING, parse_settings({"guidance": {"controller": controller}}, "here"))
    desk.stand(0.0, 0.0)
    desk.begin()
    step(desk)
    vehicle = fold(desk.run.vehicle, ParameterSeen(desk.now_s, "WP_SPEED", 1.2))
    assert desk.executor.view(vehicle, desk.now_s).rover.told_most_m_s == most_m_s


WALLED = "".join(
    f"[[keep_out]]\npolygon_fields = [{corners}]\n"
    for corners in (
        "[13, 5], [17, 5], [17, 6]",
        "[13, 9], [17, 9], [17, 8]",
        "[13, 5], [13, 9], [12, 9]",
        "[17, 5], [17, 9], [18, 9]",
    )
)
COARSE = "Map fields of 1 m may close gaps below 2.4 m; smaller ones open more"


@pytest.mark.parametrize(
    ("sees_all_round", "turning_radius_m", "field_m", "told"),
    [
        (True, 0.0, 1.0, f"{COARSE}, of 0.15 m down to 1.0 m"),
        (True, 1.0, 1.0, f"{COARSE}, of 0.25 m down to 1.2 m"),
        (True, 0.0, 0.15, "Gaps below 1.0 m may count as closed"),
        (True, 1.0, 0.25, "Gaps below 1.2 m may count as closed: arcs need wide ones"),
        (False, 0.0, 1.0, "Gaps below 2.4 m may count as closed: single beams need wide ones, a lidar sees more"),
    ],
)
def test_with_a_target_that_cannot_be_reached_it_says_which_gaps_count_as_closed(
    tmp_path: Path, sees_all_round: bool, turning_radius_m: float, field_m: float, told: str
) -> None:
    desk = Desk(tmp_path, GATE + WALLED)
    rover = replace(desk.mission.rover, turning_radius_m=turning_radius_m)
    desk.mission = replace(desk.mission, rover=rover, grid=replace(desk.mission.grid, resolution_m=field_m))
    if sees_all_round:
        desk.stand(0.0, 0.0)
    desk.begin()
    step(desk)
    assert desk.notices.texts[1].startswith("Unreachable: gate") and desk.notices.texts[2] == told


def test_a_target_that_is_tried_again_is_not_called_unreachable(tmp_path: Path) -> None:
    desk = Desk(tmp_path, GATE + 'on_blocked = "wait"\n' + WALLED)
    desk.begin()
    step(desk)
    assert desk.notices.texts[1].startswith("No way now: gate (") and "; tries again in 5 s" in desk.notices.texts[1]
    assert desk.executor.progress.tries_again and desk.executor.blocked_since_s == pytest.approx(desk.now_s)


def test_a_rover_that_is_stuck_again_and_again_says_so_every_few_times(desk: Desk) -> None:
    for _ in range(400):
        step(desk, 0.5)
    stuck = [text for text in desk.notices.texts if text.startswith("Stuck")]
    assert desk.executor.driver.stuck_here >= 2 * STUCK_TOLD
    said = "at one place, heading for gate: goes on looking for a way"
    assert stuck[:2] == [f"Stuck {times} times {said}" for times in (STUCK_TOLD, 2 * STUCK_TOLD)]
    assert len(stuck) == desk.executor.driver.stuck_here // STUCK_TOLD
