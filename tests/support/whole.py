"""A whole companion on a desk, with a link that answers as it is told to."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from companion.app import Companion
from companion.checkpoint.checkpointer import RunMoment
from companion.core.scan import RangeScan
from companion.core.tick_marks import Mark
from companion.executive.mission_executor import MissionExecutor
from companion.navigation.step_runner import InlineRunner
from companion.recording.recorder import NullRecorder
from companion.safety.reasons import WaitReason
from companion.settings import parse_settings
from companion.vehicle.commands import (
    StatusText,
)
from companion.vehicle.events import (
    AttitudeSeen,
    EkfStatusSeen,
    Event,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterSeen,
    RangeSeen,
    ThrottleSeen,
)
from companion.vehicle.rc_input import Sticks
from tests.companion.safety.test_mode_latch import EKF_GOOD, GUIDED, MANUAL, PLACE
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
            ThrottleSeen(now_s, 0.0),
            ParameterSeen(now_s, "GUID_TIMEOUT", 3.0),
            ParameterSeen(now_s, "CRUISE_SPEED", 3.0),
            ParameterSeen(now_s, "CRUISE_THROTTLE", 75.0),
            RangeSeen(now_s, RangeScan(now_s, bearings, ranges, 0.1, 8.0, 0.1, "lidar")),
        ]

    def tick(self, *events: Event, silent: bool = False) -> list[object]:
        """One tick; what it sends, texts aside."""
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
