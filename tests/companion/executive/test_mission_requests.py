"""To pause, to go on and to leave a target out: what is done, what is refused, and that a pilot keeps what he set."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.core.frames import NedPoint
from companion.executive.mission_progress import TargetStatus
from companion.executive.mission_requests import AGAIN_S, ARRIVES_S, FRESH_S, MissionRequests
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.vehicle.commands import AnswerRequest, SetMode
from companion.vehicle.events import Asker, HeartbeatSeen, PauseAsked, RequestAnswer, RoverMode, TargetAsked
from tests.support.desk import Desk

ASKER = Asker(255, 190)
TWO = """
[[target]]
name = "first"
north_m = 0.0
east_m = 5.0
[[target]]
name = "second"
north_m = 2.0
east_m = 7.0
"""


class Asked(Desk):
    """Requests reach the run; modes are set at once, unless a test says otherwise."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder, TWO)
        self.requests = MissionRequests(self.run, self.notices)
        if begun:
            self.begin()
        self.in_mode(RoverMode.GUIDED)

    def in_mode(self, mode: RoverMode) -> None:
        self.stand(0.0, 0.0, mode=mode)
        self.requests.take(HeartbeatSeen(self.now_s, mode, True, 1), self.run.vehicle)

    def ask(self, event: PauseAsked | TargetAsked) -> tuple[RequestAnswer, list[int]]:
        """The answer, and the modes that were set."""
        self.requests.take(event, self.run.vehicle)
        commands = self.autopilot.taken()
        (answer,) = [command.answer for command in commands if isinstance(command, AnswerRequest)]
        return answer, [command.mode for command in commands if isinstance(command, SetMode)]

    def pause(self) -> tuple[RequestAnswer, list[int]]:
        return self.ask(PauseAsked(self.now_s, ASKER, True))

    def go_on(self) -> tuple[RequestAnswer, list[int]]:
        return self.ask(PauseAsked(self.now_s, ASKER, False))

    def skip_to(self, index: int) -> RequestAnswer:
        answer, modes = self.ask(TargetAsked(self.now_s, ASKER, index))
        assert modes == []
        return answer

    def later(self, by_s: float) -> None:
        self.clock.time_s += by_s


OK, DENIED, NOT_NOW = RequestAnswer.ACCEPTED, RequestAnswer.DENIED, RequestAnswer.NOT_NOW


def test_a_pause_is_hold_and_going_on_is_guided_again(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    assert asked.pause() == (OK, [RoverMode.HOLD])
    asked.in_mode(RoverMode.HOLD)
    assert asked.pause() == (OK, []), "it stands already"
    asked.later(60.0)
    asked.in_mode(RoverMode.HOLD)
    assert asked.go_on() == (OK, [RoverMode.GUIDED])
    assert asked.go_on() == (OK, []), "a repetition"
    asked.in_mode(RoverMode.GUIDED)
    assert asked.go_on() == (OK, []), "it drives"


def test_a_mode_that_never_arrived_can_be_asked_for_again(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    asked.pause()
    asked.in_mode(RoverMode.HOLD)
    asked.go_on()
    asked.later(AGAIN_S)
    asked.in_mode(RoverMode.HOLD)
    assert asked.go_on() == (OK, [RoverMode.GUIDED])


@pytest.mark.parametrize("between", [RoverMode.MANUAL, RoverMode.GUIDED])
@pytest.mark.parametrize("later_s", [0.5, ARRIVES_S + 0.1])
def test_what_a_pilot_set_is_not_taken_back(tmp_path: Path, between: RoverMode, later_s: float) -> None:
    asked = Asked(tmp_path)
    asked.pause()
    asked.in_mode(RoverMode.HOLD)
    asked.in_mode(between)
    asked.later(later_s)
    asked.in_mode(RoverMode.HOLD)
    assert asked.go_on() == (DENIED, [])
    assert "set GUIDED with ground station or transmitter" in asked.notices.texts[-1]


def test_a_pilot_who_takes_over_before_the_pause_arrives_keeps_the_rover(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    asked.pause()
    asked.in_mode(RoverMode.MANUAL)
    asked.in_mode(RoverMode.HOLD)
    assert asked.go_on() == (DENIED, [])


@pytest.mark.parametrize(("armed", "since_s"), [(False, 0.0), (True, FRESH_S + 0.1)])
def test_a_rover_that_was_disarmed_or_is_not_heard_does_not_go_on(tmp_path: Path, armed: bool, since_s: float) -> None:
    asked = Asked(tmp_path)
    asked.pause()
    asked.in_mode(RoverMode.HOLD)
    asked.stand(0.0, 0.0, mode=RoverMode.HOLD, armed=armed)
    asked.later(since_s)
    assert asked.go_on() == (DENIED, [])


def test_a_pause_that_nobody_hears_is_sent_and_said_to_be_unheard(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    asked.later(FRESH_S + 0.1)
    assert asked.pause() == (DENIED, [RoverMode.HOLD])
    assert "not heard: take the rover over" in asked.notices.texts[-1]


def test_a_hold_or_another_mode_that_was_not_asked_for_here_is_not_left(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    for mode in (RoverMode.HOLD, RoverMode.MANUAL):
        asked.in_mode(mode)
        assert asked.go_on() == (DENIED, [])
    assert asked.pause() == (NOT_NOW, []), "the pilot drives"


def test_before_the_mission_begins_a_pause_keeps_it_from_beginning_and_nothing_is_skipped(tmp_path: Path) -> None:
    asked = Asked(tmp_path, begun=False)
    assert asked.pause() == (OK, []) and asked.run.start_paused and asked.skip_to(1) is NOT_NOW
    asked.in_mode(RoverMode.HOLD)
    assert asked.pause() == (OK, []) and asked.run.start_paused, "whatever the mode"
    assert asked.go_on() == (OK, []) and not asked.run.start_paused


def test_only_the_target_after_this_one_may_be_next(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    assert asked.skip_to(2) is asked.skip_to(-1) is DENIED
    assert asked.skip_to(0) is OK and asked.executor.progress.index == 0, "it is this one"
    assert asked.skip_to(1) is OK and asked.executor.progress.index == 1
    assert asked.skip_to(1) is OK and asked.executor.progress.index == 1, "a repetition skips no further one"
    assert asked.skip_to(2) is OK and asked.executor.progress.ended
    assert asked.skip_to(3) is DENIED, "the mission is over"
    assert asked.executor.progress.statuses == (TargetStatus.SKIPPED, TargetStatus.SKIPPED)


def test_a_place_that_was_asked_for_is_dropped_and_the_mission_goes_on(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    place = NedPoint(2.0, 2.0)
    cell = asked.executor.evidence.base.cell_at(place)
    asked.executor.request(ResolvedTarget("here", place, cell, 0.0, OnBlocked.SKIP, None))
    assert asked.skip_to(1) is DENIED and asked.skip_to(0) is OK
    progress = asked.executor.progress
    assert progress.requested is None and progress.goal.name == "first"
    assert progress.statuses == (TargetStatus.PENDING, TargetStatus.PENDING)


def test_a_flood_is_not_answered(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    for _ in range(30):
        asked.requests.take(TargetAsked(asked.now_s, ASKER, 7), asked.run.vehicle)
    assert len([one for one in asked.autopilot.taken() if isinstance(one, AnswerRequest)]) == 10
    assert asked.pause() == (OK, [RoverMode.HOLD]), "but anybody may stop the rover"
