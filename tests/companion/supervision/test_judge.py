"""The judge: which doubt is heard, what is told of it, and when the leg begins afresh; the limits of a mission."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.executive.mission_progress import MissionPhase
from companion.operator.notifications import Outcome
from companion.safety.battery_monitor import BatteryMonitor
from companion.safety.mode_latch import Control, Reaction
from companion.safety.reasons import Doubt, PowerReason, Reason, RunPhase, WaitReason
from companion.settings import FenceSettings, PowerSettings
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.judge import Judge
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.rival_monitor import RivalMonitor
from companion.vehicle.events import (
    BatterySeen,
    Event,
    HeartbeatSeen,
)
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import HOLD, vehicle
from tests.support.desk import Desk


class Says:
    """A monitor that doubts what it is told to."""

    def __init__(self, doubt: Doubt | None = None) -> None:
        self.said = doubt

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """Ignored."""

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        return None if self.said is None else Reason(self.said)


class Judged(Desk):
    """A mission under way before a judge with two monitors."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.first, self.second = Says(), Says()
        self.judge = Judge(self.run, (self.first, self.second), self.settings, self.notices)
        self.begin()
        self.stand(0.0, 0.0)

    def verdict(self, after_s: float = 0.0) -> Reaction:
        self.clock.time_s += after_s
        return self.judge.judge(self.now_s).reaction


def test_the_first_doubt_stops_the_rover_and_is_told(tmp_path: Path) -> None:
    judged = Judged(tmp_path)
    assert judged.verdict() is Reaction.DRIVE and not judged.run.stopped
    judged.first.said, judged.second.said = Doubt.POSITION_JUMPED, Doubt.LOOP_LATE
    assert judged.verdict() is Reaction.STOP and judged.run.stopped
    assert judged.notices.texts == ["Stopping: position jumped"]
    assert judged.run.activity.phase is RunPhase.STOPPED
    judged.first.said = None
    assert judged.verdict() is Reaction.STOP and judged.notices.texts[-1] == "Stopping: the companion is too slow"
    assert judged.verdict(5.0) is Reaction.HOLD and judged.notices.texts[-1] == "HOLD: the companion is too slow"
    assert judged.run.latch.control is Control.PERSON


def test_the_leg_begins_afresh_at_each_change_and_not_between(tmp_path: Path) -> None:
    judged, afresh = Judged(tmp_path), []
    judged.run.start_afresh = lambda: afresh.append(judged.now_s)  # type: ignore[method-assign]
    for doubt, count in ((None, 1), (None, 1), (Doubt.LOOP_LATE, 2), (Doubt.LOOP_LATE, 2), (None, 3), (None, 3)):
        judged.first.said = doubt
        judged.verdict()
        assert len(afresh) == count


def test_a_companion_that_falls_silent_says_what_it_waits_for(tmp_path: Path) -> None:
    judged = Judged(tmp_path)
    judged.verdict()
    judged.stand(0.0, 0.0, mode=HOLD)
    assert judged.verdict() is Reaction.SILENT and judged.notices.texts == ["Companion silent: mode is not GUIDED"]
    activity = judged.run.activity
    assert activity.phase is RunPhase.STOPPED_AND_WAITING and activity.needs_person
    assert activity.awaited is not None and activity.awaited.kind is WaitReason.PERSON_SETS_MODE
    judged.verdict()
    assert len(judged.notices.told) == 1, "once"


# The limits of a mission ----------------------------------------------------------------------------------------------

POWER = PowerSettings(return_percent=20.0, hold_percent=10.0, after_s=1.0)


class Limited(Desk):
    """A mission with its limits."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder)
        link: Any = self.autopilot
        self.outcome, self.batteries, self.rivals = Outcome(), BatteryMonitor(POWER), RivalMonitor(link)
        self.fences = FenceMonitor(link, FenceSettings(heed="never"), self.notices)
        self.limits = MissionLimits(self.run, self.fences, self.batteries, self.rivals, POWER, self.outcome)
        if begun:
            self.begin()
            self.executor.decide(self.stand(0.0, 0.0), self.now_s)

    def drain(self, percent: int) -> None:
        """For long enough to be believed."""
        for _ in range(3):
            self.batteries.take(BatterySeen(self.now_s, 0, 12.0, percent), self.run.vehicle)
            self.batteries.level(self.now_s)
            self.clock.time_s += 0.6


def test_what_is_awaited_before_a_mission(tmp_path: Path) -> None:
    limited = Limited(tmp_path, begun=False)
    found = limited.limits.awaited(10.0, left_driving=False)
    assert found is not None and found.kind is WaitReason.OTHER_COMPANION_SIGNS
    limited.rivals.take(HeartbeatSeen(10.0, HOLD, True, 1), vehicle())
    assert limited.limits.awaited(10.0, left_driving=False) is None
    limited.drain(15)
    found = limited.limits.awaited(limited.now_s, left_driving=False)
    assert found is not None and found.kind is WaitReason.CHARGED_BATTERY
    assert limited.limits.awaited(limited.now_s, left_driving=True) is None, "a reason to go back, not to stay"
    assert limited.limits.must_stop(limited.now_s) is None


@pytest.mark.parametrize("percent", [15, 5])
def test_a_low_battery_breaks_a_mission_off(tmp_path: Path, percent: int) -> None:
    limited = Limited(tmp_path)
    assert limited.limits.enforce(limited.now_s) is None and limited.outcome.broken_off is None
    limited.drain(percent)
    why = Reason(PowerReason.CHARGE, ("battery", percent))
    stops = percent == 5
    for _ in range(2):
        assert limited.limits.enforce(limited.now_s) == (why if stops else None)
    assert limited.outcome.broken_off == why
    assert (limited.executor.progress.phase is MissionPhase.HOME) is not stops
    assert len([text for text in limited.notices.texts if text.startswith("Returning: ")]) == (0 if stops else 1)
