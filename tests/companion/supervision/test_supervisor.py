"""A whole companion on a desk: from the first heartbeat to HOLD, with a link that answers as it is told to."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.app import Companion
from companion.checkpoint.checkpointer import RunMoment
from companion.core.clock import stopwatch_s
from companion.core.round_marks import Mark
from companion.core.scan import RangeScan
from companion.core.severity import Severity
from companion.executive.mission_executor import MissionExecutor
from companion.navigation.step_runner import InlineRunner
from companion.operator.notifications import News
from companion.recording.recorder import NullRecorder
from companion.safety.reasons import Doubt, EndReason, Reason, RunPhase, WaitReason
from companion.settings import parse_settings
from companion.settings.live_settings import LiveSettings
from companion.supervision.assembly import Options, assemble
from companion.supervision.keeper import Keeper
from companion.supervision.listener import Listener
from companion.supervision.pace import Pace
from companion.supervision.supervisor import Supervisor
from companion.vehicle.commands import (
    AnswerTarget,
    Arm,
    GuidedHeading,
    GuidedPosition,
    ParameterValue,
    SetMode,
    StatusText,
)
from companion.vehicle.events import (
    AckSeen,
    AttitudeSeen,
    EkfStatusSeen,
    Event,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterAsked,
    RangeSeen,
    RoverMode,
    TextSeen,
)
from companion.vehicle.rc_input import Sticks
from tests.companion.safety.test_mode_latch import EKF_GOOD, GUIDED, HOLD, MANUAL, PLACE
from tests.support.desk import Desk
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import HandClock
from tests.support.rig import yard

SETTINGS = parse_settings({"fence": {"heed": "never"}}, "test")


@dataclass
class Log(NullRecorder):
    """Keeps marks."""

    marks: list[Mark] = field(default_factory=list)

    def mark(self, mark: Mark) -> None:
        self.marks.append(mark)

    def begin(self, time_s: float, mark: Mark) -> None:
        self.marks.append(mark)


@dataclass
class Kept:
    """Stands in for what keeps the state of a run."""

    previous: None = None
    sticks: Sticks = field(default_factory=Sticks)
    notes: list[bool] = field(default_factory=list)
    problem: str = ""

    def resume(self, executor: MissionExecutor, *others: object) -> bool:
        return False

    def update(self, moment: RunMoment) -> None:
        self.notes.append(moment.done)

    def problem_text(self, log: object) -> str:
        return self.problem


class Whole:
    """A companion, and the vehicle that it hears."""

    def __init__(self, folder: Path) -> None:
        self.autopilot, self.clock, self.log, self.memory = FakeAutopilot(), HandClock(100.0), Log(), Kept()
        link: Any = self.autopilot
        memory: Any = self.memory
        self.mode, self.armed = int(MANUAL), False
        self.companion = Companion(
            link, self.clock, yard(folder), SETTINGS, InlineRunner(), self.log, seed=0, arm=True, checkpointer=memory
        )

    def heard(self) -> list[Event]:
        now_s = self.clock.time_s + 0.05
        bearings = np.radians(np.arange(-180.0, 180.0, 4.0))
        ranges = np.full(len(bearings), np.inf)
        return [
            HeartbeatSeen(now_s, self.mode, self.armed, 1),
            OriginSeen(now_s, PLACE),
            HomeSeen(now_s, PLACE),
            LocalPositionSeen(now_s, now_s, 0.0, 0.0, 0.0, 0.0),
            AttitudeSeen(now_s, now_s, 0.0, 0.0),
            EkfStatusSeen(now_s, EKF_GOOD),
            RangeSeen(now_s, RangeScan(now_s, bearings, ranges, 0.1, 8.0, 0.1, "lidar")),
        ]

    def tick(self, *events: Event, silent: bool = False) -> list[object]:
        """One round; what it sends, texts aside."""
        self.autopilot.events = [*([] if silent else self.heard()), *events]
        self.companion.tick()
        return [command for command in self.autopilot.taken() if not isinstance(command, StatusText)]

    def awaited(self) -> WaitReason | None:
        awaited = self.companion.status().activity.awaited
        return None if awaited is None else awaited.kind

    def drive(self) -> list[object]:
        self.mode, self.armed = int(GUIDED), True
        return self.ticks(2.0)  # a rover that is armed in GUIDED is listened to first

    def ticks(self, seconds: float) -> list[object]:
        return [command for _ in range(round(20.0 * seconds)) for command in self.tick()]


@pytest.fixture
def whole(tmp_path: Path) -> Whole:
    return Whole(tmp_path)


def test_from_the_first_heartbeat_to_the_first_setpoint(whole: Whole) -> None:
    assert whole.tick(silent=True) == [] and whole.awaited() is WaitReason.HEARTBEAT
    assert whole.companion.executor is None and whole.companion.status().activity.phase is RunPhase.WAITING
    assert whole.tick() == [SetMode(RoverMode.GUIDED)] and whole.awaited() is WaitReason.GUIDED
    whole.mode = int(GUIDED)
    assert Arm() in whole.ticks(3.2) and whole.awaited() is WaitReason.ARMING
    whole.autopilot.ack = AckSeen(whole.clock.time_s, 400, 4)
    whole.tick()
    assert whole.companion.outcome.said[-1] == "The autopilot refuses to arm (result 4)"
    whole.autopilot.ack = None
    sent = whole.drive()
    assert whole.companion.executor is not None and whole.companion.status().activity.phase is RunPhase.DRIVING
    assert any(isinstance(command, GuidedPosition | GuidedHeading) for command in sent)
    assert "Companion: Yard, 1 targets" in whole.companion.outcome.said
    assert whole.memory.notes and not any(whole.memory.notes)


def test_another_companion_with_our_id_is_waited_for(whole: Whole) -> None:
    whole.autopilot.twin = True
    assert whole.tick() == [] and whole.awaited() is WaitReason.OTHER_COMPANION_SILENT


def test_a_stop_ends_the_run_in_hold(whole: Whole) -> None:
    whole.drive()
    whole.companion.stop()
    assert SetMode(RoverMode.HOLD) in whole.tick()
    end = Reason(EndReason.STOPPED_BY_USER)
    assert whole.companion.mission_run.end == end and Mark.STOP in whole.log.marks and not whole.companion.done
    whole.mode = int(HOLD)
    assert whole.tick() == [] and whole.companion.done and whole.memory.notes[-1]
    assert whole.companion.status().doing == "stopped by the user" and not whole.companion.outcome.complete


def test_an_error_ends_the_run_in_hold_before_close_returns(whole: Whole) -> None:
    whole.drive()
    whole.companion.close()
    assert SetMode(RoverMode.HOLD) in whole.autopilot.taken() and whole.companion.done
    assert whole.log.marks[-1] is Mark.CLOSE and whole.memory.notes[-1]
    whole.companion.close()
    assert whole.autopilot.taken() == [], "once"


def test_a_computer_that_stood_still_believes_nothing_at_once(whole: Whole) -> None:
    whole.drive()
    sleep = whole.clock.sleep_until_s
    whole.clock.sleep_until_s = lambda time_s: sleep(time_s + 3.0)  # type: ignore[method-assign]
    whole.tick()
    whole.clock.sleep_until_s = sleep  # type: ignore[method-assign]
    whole.tick()
    assert f"Stopping: {Doubt.LOOP_STOOD_STILL.value}" in whole.companion.outcome.said


def test_faults_that_stop_nothing_are_told_once(whole: Whole) -> None:
    whole.drive()
    whole.memory.problem = "The state cannot be saved"
    whole.tick()
    whole.tick()
    assert whole.companion.outcome.said.count("The state cannot be saved") == 1


def test_ground_stations_are_answered_and_the_autopilots_warnings_shown(whole: Whole) -> None:
    answers = whole.tick(ParameterAsked(100.0, "CMP_STALE", -1), TextSeen(100.0, 3, "Bad battery"))
    assert [answer.name for answer in answers if isinstance(answer, ParameterValue)] == ["CMP_STALE"]
    assert not any(isinstance(answer, AnswerTarget) for answer in answers)
    assert whole.companion.status().news == (News(Severity.ERROR, "autopilot: Bad battery"),)
    whole.tick()
    assert whole.companion.status().news == ()


# The parts -----------------------------------------------------------------------------------------------------------


def test_the_monitors_stand_in_their_order_of_precedence(tmp_path: Path) -> None:
    link: Any = FakeAutopilot()
    parts = assemble(link, HandClock(), yard(tmp_path), SETTINGS, InlineRunner(), Log(), Options(seed=0, arm=False))
    assert isinstance(parts.supervisor, Supervisor) and isinstance(parts.listener, Listener)
    names = [type(monitor).__name__ for monitor in parts.supervisor._judge._monitors]
    assert names == [
        "SticksMonitor",
        "DataMonitor",
        "LocalizationMonitor",
        "LoopMonitor",
        "ScanMonitor",
        "RivalMonitor",
        "FenceMonitor",
        "BorderMonitor",
    ]


class Stalls:
    """Counts how often it is told that the loop stood still."""

    count = 0

    def stalled(self, now_s: float) -> None:
        self.count += 1


def test_the_pace_is_that_of_the_settings_and_does_not_catch_up_after_a_stall() -> None:
    clock, stalls, live = HandClock(10.0), Stalls(), LiveSettings(SETTINGS)
    localization: Any = stalls
    pace, period_s = Pace(clock, live, localization), 1.0 / SETTINGS.link.tick_hz
    assert [pace.sleep(), pace.sleep()] == pytest.approx([10.0 + period_s, 10.0 + 2.0 * period_s])
    assert pace.late_s == 0.0 and stalls.count == 0
    clock.sleep_until_s = lambda time_s: setattr(clock, "time_s", 20.0)  # type: ignore[method-assign]
    assert pace.sleep() == 20.0 and pace.late_s > 1.0 and stalls.count == 1
    del clock.sleep_until_s  # type: ignore[attr-defined]
    assert pace.sleep() == pytest.approx(20.0 + period_s) and pace.late_s == 0.0
    assert 0.0 <= pace.elapsed_s <= stopwatch_s()


def test_without_a_state_file_nothing_is_kept(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    executor = desk.begin()
    told: list[str] = []
    notifier: Any = type("Told", (), {"tell_faults": lambda self, run, now_s, problem: told.append(problem)})()
    unused: Any = None
    keeper = Keeper(desk.run, None, Log(), notifier, unused, unused)
    keeper.note(10.0, done=True)
    keeper.tell_faults(10.0)
    assert not keeper.resume(executor, 10.0) and told == [""]
