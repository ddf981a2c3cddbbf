"""Drive permission: which doubt counts, what is told of it, and when the leg begins afresh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from companion.safety.mode_latch import Control, Reaction
from companion.safety.reasons import Doubt, Reason, RunPhase, WaitReason
from companion.supervision.drive_permission import DrivePermission
from companion.vehicle.events import Event, HeartbeatSeen, RoverMode
from companion.vehicle.state import VehicleState, fold
from tests.companion.safety.test_mode_latch import GUIDED, HOLD
from tests.support.desk import Desk


class Says:
    """A monitor that doubts what it is told to."""

    def __init__(self, doubt: Doubt | None = None) -> None:
        self.said = doubt
        self.figures: tuple[object, ...] = ()

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """Ignored."""

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        return None if self.said is None else Reason(self.said, self.figures)


class Permitted(Desk):
    """A mission under way with two monitors."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.first, self.second = Says(), Says()
        self.permission = DrivePermission(self.run, (self.first, self.second), self.settings, self.notices)
        self.begin()
        self.stand(0.0, 0.0)

    def verdict(self, after_s: float = 0.0) -> Reaction:
        self.clock.time_s += after_s
        return self.permission.check(self.now_s).reaction


def test_the_first_doubt_stops_the_rover_and_is_told(tmp_path: Path) -> None:
    permitted = Permitted(tmp_path)
    assert permitted.verdict() is Reaction.DRIVE and not permitted.run.stopped
    permitted.first.said, permitted.second.said = Doubt.POSITION_JUMPED, Doubt.LOOP_LATE
    assert permitted.verdict() is Reaction.STOP and permitted.run.stopped
    assert permitted.notices.texts == ["Stopping: position jumped"]
    assert permitted.run.activity.phase is RunPhase.STOPPED
    permitted.first.said = None
    assert permitted.verdict() is Reaction.STOP and permitted.notices.texts[-1] == "Stopping: the companion is too slow"
    assert permitted.verdict(5.0) is Reaction.HOLD and permitted.notices.texts[-1] == "HOLD: the companion is too slow"
    assert permitted.run.latch.control is Control.PERSON
    permitted.stand(0.0, 0.0, mode=HOLD)
    assert permitted.verdict() is Reaction.SILENT and not permitted.run.taken_over, "this HOLD is the companion's own"


def test_why_hold_was_asked_for_is_known_until_it_drives_again(tmp_path: Path) -> None:
    """An autopilot that is silent has led to everything else."""
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.first.said, permitted.first.figures = Doubt.DATA_OLD, ("position", 1.0)
    assert permitted.verdict() is Reaction.STOP and permitted.run.held_for is None
    assert permitted.verdict(5.0) is Reaction.HOLD and str(permitted.run.held_for) == "position silent for over 1 s"
    permitted.verdict(20.0)
    assert str(permitted.run.held_for) == "autopilot silent for over 25 s"
    permitted.first.said = None
    permitted.stand(0.0, 0.0, mode=HOLD)
    assert permitted.verdict() is Reaction.SILENT and not permitted.run.taken_over
    assert str(permitted.run.held_for) == "autopilot silent for over 25 s"
    permitted.stand(0.0, 0.0)
    assert permitted.verdict() is Reaction.DRIVE and permitted.run.held_for is None


def test_an_autopilot_that_falls_silent_later_is_not_why_hold_was_asked_for(tmp_path: Path) -> None:
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.first.said = Doubt.STICKS_MOVED
    assert permitted.verdict() is Reaction.HOLD
    permitted.verdict(20.0)
    assert permitted.run.held_for == Reason(Doubt.STICKS_MOVED)


def test_the_leg_begins_afresh_at_each_change_and_not_between(tmp_path: Path) -> None:
    permitted, afresh = Permitted(tmp_path), []
    permitted.run.start_afresh = lambda: afresh.append(permitted.now_s)  # type: ignore[method-assign]
    for doubt, count in ((None, 1), (None, 1), (Doubt.LOOP_LATE, 2), (Doubt.LOOP_LATE, 2), (None, 3), (None, 3)):
        permitted.first.said = doubt
        permitted.verdict()
        assert len(afresh) == count


def test_a_companion_that_falls_silent_says_what_it_waits_for(tmp_path: Path) -> None:
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.stand(0.0, 0.0, mode=HOLD)
    assert permitted.verdict() is Reaction.SILENT
    assert permitted.notices.texts == [
        "Companion no longer steers: mode is not GUIDED; it waits for a person to set GUIDED"
    ]
    activity = permitted.run.activity
    assert activity.phase is RunPhase.STOPPED_AND_WAITING and activity.needs_person
    assert activity.awaited is not None and activity.awaited.kind is WaitReason.PERSON_SETS_MODE
    permitted.verdict()
    assert len(permitted.notices.told) == 1, "once"
    assert permitted.run.taken_over, "somebody else has set this HOLD"
    permitted.stand(0.0, 0.0)
    assert permitted.verdict() is Reaction.DRIVE and not permitted.run.taken_over


def test_a_pause_that_was_asked_for_was_told_then_and_is_not_told_again(tmp_path: Path) -> None:
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.stand(0.0, 0.0, mode=HOLD)
    permitted.run.paused = True
    assert permitted.verdict() is Reaction.SILENT
    assert permitted.notices.texts == [] and not permitted.run.taken_over
    activity = permitted.run.activity
    assert activity.needs_person and str(activity) == (
        "stopped: paused on request, waiting for a person to ask it to go on, or to set GUIDED"
    )


def test_an_autopilot_that_has_restarted_is_why_it_stands(tmp_path: Path) -> None:
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.stand(0.0, 0.0, mode=RoverMode.MANUAL, armed=False)
    permitted.run.vehicle = replace(permitted.run.vehicle, restarted=True)
    assert permitted.verdict() is Reaction.SILENT and not permitted.run.taken_over
    assert permitted.notices.texts[0].startswith("Companion no longer steers: autopilot restarted, rover disarmed")
    assert str(permitted.run.activity).startswith("stopped: autopilot restarted, rover disarmed, waiting for a person")


def test_who_drives_is_followed_from_heartbeat_to_heartbeat_before_the_mission(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    permission = DrivePermission(desk.run, (), desk.settings, desk.notices)
    for mode in (GUIDED, HOLD):
        heartbeat = HeartbeatSeen(11.0, mode, False, 1)
        desk.run.vehicle = fold(desk.run.vehicle, heartbeat)
        permission.take(heartbeat, desk.run.vehicle)
    assert desk.run.latch.control is Control.PERSON


def test_what_a_person_is_to_do_is_told_without_the_data_that_comes_and_goes(tmp_path: Path) -> None:
    """Else the same text would be told anew with each other age of a message."""
    permitted = Permitted(tmp_path)
    permitted.verdict()
    permitted.stand(0.0, 0.0, mode=HOLD)
    permitted.run.vehicle = replace(permitted.run.vehicle, position=None)
    permitted.verdict()
    assert permitted.run.activity.awaited is not None
    assert permitted.run.activity.awaited.kind is WaitReason.GOOD_DATA_AND
    assert permitted.notices.texts[-1].endswith("; it waits for a person to set GUIDED")
