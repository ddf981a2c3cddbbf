"""The judge: which doubt is heard, what is told of it, and when the leg begins afresh."""

from __future__ import annotations

from pathlib import Path

from companion.safety.mode_latch import Control, Reaction
from companion.safety.reasons import Doubt, Reason, RunPhase, WaitReason
from companion.supervision.judge import Judge
from companion.vehicle.events import (
    Event,
)
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import HOLD
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
