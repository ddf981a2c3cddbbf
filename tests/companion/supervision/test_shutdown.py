"""The end of a run: whose rover it is, what is sent, and how long is waited."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.control.controller import STOP
from companion.core.severity import Severity
from companion.safety.mode_latch import Control, LatchState
from companion.safety.reasons import Activity, EndReason, Parting, Reason, RunPhase
from companion.supervision.shutdown import AGAIN_S, CONFIRM_S, Shutdown
from companion.vehicle.commands import SetMode
from companion.vehicle.events import AckSeen, HeartbeatSeen, RoverMode
from companion.vehicle.state import fold
from tests.companion.safety.test_mode_latch import HOLD
from tests.support.desk import Desk

DONE, ERROR = Reason(EndReason.DONE), Reason(EndReason.ERROR)
TO_HOLD = SetMode(RoverMode.HOLD)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    desk = Desk(tmp_path)
    desk.begin()
    desk.run.latch = LatchState(Control.COMPANION)
    return desk


def ending(desk: Desk) -> Shutdown:
    link: Any = desk.autopilot
    return Shutdown(desk.run, link, desk.settings, desk.notices)


@pytest.mark.parametrize(
    ("why", "told"), [(DONE, []), (ERROR, [("Companion: an error in the program, HOLD", Severity.WARNING)])]
)
def test_a_rover_of_ours_is_stopped_and_put_into_hold(desk: Desk, why: Reason[EndReason], told: list[Any]) -> None:
    shutdown = ending(desk)
    shutdown.begin(why, 10.0)
    assert desk.autopilot.taken() == [STOP, TO_HOLD] and shutdown.stopped_ours
    assert desk.run.end == why and desk.run.activity == Activity(RunPhase.ENDED, why) and desk.notices.told == told
    assert not shutdown.is_over(10.0 + AGAIN_S / 2.0) and desk.autopilot.taken() == []
    assert not shutdown.is_over(10.0 + AGAIN_S) and desk.autopilot.taken() == [TO_HOLD], "asked again"
    assert shutdown.is_over(10.0 + CONFIRM_S), "time is up"


@pytest.mark.parametrize("how", ["answered", "left"])
def test_it_is_over_as_soon_as_the_rover_will_be_in_hold(desk: Desk, how: str) -> None:
    shutdown = ending(desk)
    shutdown.begin(DONE, 10.0)
    desk.autopilot.ack = AckSeen(9.9, 176, 0)
    assert not shutdown.is_over(10.05), "an answer of before"
    if how == "answered":
        desk.autopilot.ack = AckSeen(10.1, 176, 0)
    else:
        desk.stand(0.0, 0.0, mode=HOLD)
    assert shutdown.is_over(10.1)


@pytest.mark.parametrize("whose", ["a person's", "another companion's", "in another mode", "disarmed"])
def test_a_rover_that_is_not_ours_is_left_alone(tmp_path: Path, whose: str) -> None:
    desk = Desk(tmp_path)
    desk.run.latch = LatchState(Control.PERSON if whose == "a person's" else Control.COMPANION)
    desk.autopilot.twin = whose == "another companion's"
    if whose == "in another mode":
        desk.stand(0.0, 0.0, mode=HOLD)
    if whose == "disarmed":
        desk.stand(0.0, 0.0, armed=False)
    shutdown = ending(desk)
    shutdown.begin(ERROR, 10.0)
    expected = [TO_HOLD] if whose == "disarmed" else []
    assert desk.autopilot.taken() == expected and shutdown.stopped_ours == bool(expected)
    assert shutdown.is_over(10.0) == (not expected)


def test_after_an_error_it_listens_until_it_is_over(desk: Desk) -> None:
    shutdown = ending(desk)
    shutdown.begin(ERROR, 10.0)
    desk.autopilot.events = [HeartbeatSeen(10.05, HOLD, True, 1)]
    assert shutdown.wait(desk.clock, 10.0) == pytest.approx(10.05)
    assert desk.autopilot.served == 1 and desk.clock.time_s == pytest.approx(10.05)


ARMED_IN_HOLD = Reason(Parting.ARMED, ("HOLD",))


@pytest.mark.parametrize(
    ("what", "left"),
    [
        ("answered", ARMED_IN_HOLD),
        ("in hold", ARMED_IN_HOLD),
        ("not answered", Reason(Parting.NOT_HELD)),
        ("taken over", Reason(Parting.ARMED, ("MANUAL",))),
        ("disarmed", None),
        ("silent", Reason(Parting.SILENT)),
    ],
)
def test_it_says_how_the_rover_is_left(desk: Desk, what: str, left: Reason[Parting] | None) -> None:
    shutdown = ending(desk)
    shutdown.begin(DONE, 10.0)
    end_s = 10.0 + CONFIRM_S
    desk.run.vehicle = fold(desk.run.vehicle, HeartbeatSeen(10.1, RoverMode.GUIDED, True, 1))
    match what:
        case "answered":
            desk.autopilot.ack = AckSeen(10.2, 176, 0)
        case "silent":
            end_s += desk.settings.current.safety.heartbeat_s
        case "in hold" | "taken over" | "disarmed":
            mode = RoverMode.MANUAL if what == "taken over" else RoverMode.HOLD
            desk.run.vehicle = fold(desk.run.vehicle, HeartbeatSeen(10.3, mode, what != "disarmed", 1))
    assert shutdown.parting(end_s) == left


def test_it_does_not_say_hold_of_an_autopilot_that_is_silent(desk: Desk) -> None:
    silent_s = desk.settings.current.safety.heartbeat_s + 10.0
    desk.run.vehicle = fold(desk.run.vehicle, HeartbeatSeen(9.0, RoverMode.GUIDED, True, 1))
    ending(desk).begin(Reason(EndReason.STOPPED_BY_USER), silent_s)
    expected = "Companion: stopped by the user, HOLD asked for, but the autopilot is silent"
    assert desk.notices.told == [(expected, Severity.WARNING)]
