"""One run: what a verdict makes of a tick, and what is sent for it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from companion.control.controller import STANDSTILL, Purpose
from companion.control.drag import DragWatch
from companion.control.local_view import LocalView
from companion.control.point_controller import ControlCommand
from companion.core.frames import NedPoint
from companion.executive.mission_executor import MissionExecutor, MissionTask
from companion.executive.mission_progress import TargetStatus
from companion.executive.mission_run import LocatedScan, MissionRun, Order, Stop
from companion.safety.mode_latch import Reaction, Verdict
from companion.safety.reasons import Activity, Doubt, EndReason, Reason, RunPhase, WaitReason
from companion.vehicle.commands import GuidedPosition, SetMode
from companion.vehicle.events import RoverMode, ThrottleSeen
from tests.support.desk import Desk

DRIVE = Verdict(Reaction.DRIVE)


@pytest.mark.parametrize(
    ("reaction", "order", "command"),
    [
        (Reaction.SILENT, Order.NOTHING, None),
        (Reaction.STOP, Order.STOP, STANDSTILL),
        (Reaction.HOLD, Order.HOLD, SetMode(RoverMode.HOLD)),
    ],
)
@pytest.mark.parametrize("begun", [True, False])
def test_a_verdict_that_is_not_to_drive_decides_alone(
    tmp_path: Path, reaction: Reaction, order: Order, command: object, begun: bool
) -> None:
    desk = Desk(tmp_path)
    if begun:
        desk.begin()
    task = desk.run.decide(Verdict(reaction), desk.now_s)
    assert task is order and desk.run.guide(task, desk.now_s) == command


def test_before_the_mission_has_begun_nothing_is_driven(tmp_path: Path) -> None:
    run = Desk(tmp_path).run
    assert run.decide(DRIVE, 10.0) is Order.NOTHING and run.guide(MissionTask.DRIVE, 10.0) is None
    assert run.statuses() == [("gate", TargetStatus.PENDING)] and not run.is_driving
    run.map([])
    run.start_afresh()


def test_a_mission_that_drives_speaks_setpoints_that_were_checked(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    desk.begin()
    seen = desk.stand(0.0, 0.0)
    pose = seen.pose_at(desk.now_s)
    assert pose is not None and seen.scan is not None
    desk.run.map([LocatedScan(pose, 0.0, seen.scan.scan)] * 3)
    task = desk.run.decide(DRIVE, desk.now_s)
    assert task is MissionTask.DRIVE and desk.run.activity == Activity(RunPhase.DRIVING) and desk.run.is_driving
    command = desk.run.guide(task, desk.now_s)
    assert isinstance(command, ControlCommand)
    desk.run.speak(command, desk.now_s)
    assert desk.autopilot.taken()[0] == command.setpoint
    assert desk.run.setpoint_check.refused.total() == 0


def test_what_is_seen_of_a_moment_has_how_fast_positions_were_told_to_be_driven_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = list[LocalView]()
    guide = MissionExecutor.guide
    monkeypatch.setattr(MissionExecutor, "guide", lambda self, task, view: seen.append(view) or guide(self, task, view))
    desk = Desk(tmp_path)
    desk.begin()
    for speed_m_s in (2.0, 2.0, 1.0, 1.0, 1.0):
        desk.stand(0.0, 0.0)
        desk.run.guide(desk.run.decide(DRIVE, desk.now_s), desk.now_s)
        desk.clock.time_s += 4.0
        desk.run.speak(ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(5.0, 0.0)), speed_m_s), desk.now_s)
    assert [view.placed_m_s for view in seen] == [math.inf, math.inf, 2.0, 2.0, 1.0]


def test_positions_come_nearer_where_the_throttle_is_open_and_the_rover_stands(tmp_path: Path) -> None:
    """By CRUISE_SPEED and CRUISE_THROTTLE firm ground would let it go at 1.6 m/s."""
    ways_m = {}
    for share in (0.0, 0.4):
        desk = Desk(tmp_path, '[[target]]\nname = "north"\nfield = [2, 14]\n')
        desk.begin()
        parameters = {"CRUISE_SPEED": 2.0, "CRUISE_THROTTLE": 50.0}
        places_m = []
        for tick in range(20):
            desk.clock.time_s += 0.05
            seen = desk.stand(0.0, 0.0)
            pose = seen.pose_at(desk.now_s)
            assert pose is not None and seen.scan is not None
            if tick < 3:
                desk.run.map([LocatedScan(pose, 0.0, seen.scan.scan)])
                evidence = desk.executor.evidence
                evidence.log_odds[round((7.5 + 3.5) / evidence.evidence_m) :] = 0.0  # unseen from 3.5 m on
            throttle = ThrottleSeen(desk.now_s, share if tick > 10 else 0.0)
            desk.run.vehicle = replace(desk.run.vehicle, throttle=throttle, parameters=parameters)
            command = desk.run.guide(desk.run.decide(DRIVE, desk.now_s), desk.now_s)
            assert isinstance(command, ControlCommand)
            desk.run.speak(command, desk.now_s)
            if isinstance(command.setpoint, GuidedPosition):
                places_m.append(pose.point.distance_m(command.setpoint.point))
        ways_m[share] = places_m[-1] - places_m[0]
    assert ways_m[0.4] < -0.15 and ways_m[0.0] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("misleads", [True, False])
def test_nothing_is_learnt_of_a_rover_that_the_ground_drags(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, misleads: bool
) -> None:
    learnt = list[LocalView]()
    monkeypatch.setattr(DragWatch, "misleads", lambda self: misleads)
    monkeypatch.setattr(MissionExecutor, "learn", lambda self, view: learnt.append(view))
    desk = Desk(tmp_path)
    desk.begin()
    desk.stand(0.0, 0.0)
    desk.run.guide(desk.run.decide(DRIVE, desk.now_s), desk.now_s)
    assert len(learnt) == (not misleads)


@pytest.mark.parametrize("stands", ["stopped", "ending"])
def test_a_run_that_is_stopped_or_ends_is_not_driving(tmp_path: Path, stands: str) -> None:
    desk = Desk(tmp_path)
    desk.begin()
    run: MissionRun = desk.run
    why = Reason(EndReason.DONE)
    run.stop, run.end = (Stop(None), None) if stands == "stopped" else (None, why)
    assert not run.is_driving


def test_what_the_run_does_follows_from_its_state(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    run, wait, why = desk.run, Reason(WaitReason.GUIDED), Reason(Doubt.LOOP_LATE)
    assert run.activity == Activity(RunPhase.CONNECTING)
    run.awaited = wait
    assert run.activity == Activity(RunPhase.WAITING, awaited=wait)
    desk.begin()
    assert run.activity == Activity(RunPhase.DRIVING)
    run.stop = Stop(why)
    assert run.activity == Activity(RunPhase.STOPPED, why)
    run.stop = Stop(why, wait)
    assert run.activity == Activity(RunPhase.STOPPED_AND_WAITING, why, wait)
    run.end = Reason(EndReason.DONE)
    assert run.activity == Activity(RunPhase.ENDED, run.end)


def test_starting_afresh_leaves_the_leg_and_says_all_again(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    desk.begin()
    desk.run.speak(STANDSTILL, 10.0)
    desk.run.decide(DRIVE, desk.now_s)
    desk.run.speak(STANDSTILL, 10.05)
    assert len(desk.autopilot.taken()) == 1
    desk.run.start_afresh()
    assert desk.executor.driver.goal is None
    desk.run.speak(STANDSTILL, 10.1)
    assert len(desk.autopilot.taken()) == 1


def test_an_ended_mission_sends_nothing(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    desk.begin()
    assert desk.run.guide(MissionTask.END, desk.now_s) is None
