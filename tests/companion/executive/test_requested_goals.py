"""Places that people ask for: which are refused, for what reason, and how often that is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import LocalFrame, NedPoint
from companion.executive.mission_progress import MissionPhase
from companion.executive.requested_goals import MOST_A_SECOND, REFUSED_AGAIN_S, RequestedGoals, refusal
from companion.mission.bounds import Bounds
from companion.safety.reasons import Reason, Refusal
from companion.vehicle.commands import AnswerRequest
from companion.vehicle.events import (
    Asker,
    EkfStatusSeen,
    GoalRequested,
    RequestAnswer,
    RequestForm,
    RoverMode,
)
from tests.companion.safety.test_mode_latch import PLACE
from tests.support.desk import Desk

ASKER = Asker(255, 190)
NEAR = NedPoint(3.0, 3.0)


class Asked(Desk):
    """Requests reach the run; the answers are kept."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder)
        self.requests = RequestedGoals(self.run, self.settings, self.notices)
        if begun:
            self.begin()
        self.stand(0.0, 0.0)

    def ask(self, place: NedPoint | None = NEAR, speed_m_s: float | None = None, **fault: Any) -> RequestAnswer:
        point = None if place is None else LocalFrame(PLACE).to_geo(place)
        asked = GoalRequested(self.now_s, ASKER, RequestForm.COMMAND, point, speed_m_s, **fault)
        self.requests.take(asked, self.run.vehicle)
        answers = [command for command in self.autopilot.taken() if isinstance(command, AnswerRequest)]
        return answers[-1].answer


def test_an_accepted_place_is_driven_with_no_more_than_the_missions_speed(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    assert asked.ask(speed_m_s=9.0) is RequestAnswer.ACCEPTED
    goal = asked.executor.progress.requested
    assert goal is not None and goal.point.distance_m(NEAR) < 0.02 and goal.speed_m_s == 2.0
    assert asked.ask(speed_m_s=9.0) is RequestAnswer.ACCEPTED, "a repetition"
    assert asked.executor.progress.requested == goal and len(asked.notices.told) == 1


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        (NedPoint(600.0, 0.0), Refusal.TOO_FAR),
        (NedPoint(-20.0, 0.0), Refusal.OFF_THE_GRID),
        (NEAR, None),
    ],
)
def test_a_place_is_judged_by_what_is_known(tmp_path: Path, place: NedPoint, kind: Refusal | None) -> None:
    asked = Asked(tmp_path)
    found = refusal(place, NedPoint(0.0, 0.0), asked.executor.layout, 500.0)
    assert (None if found is None else found.kind) is kind
    assert asked.ask(place) is (RequestAnswer.ACCEPTED if kind is None else RequestAnswer.DENIED)


class _Fence(Bounds):
    """Says one thing of every place."""

    def __init__(self, outside: str = "", near: str = "") -> None:
        super().__init__()
        object.__setattr__(self, "_told", (outside, near))

    def outside(self, point: NedPoint) -> str:
        return self._told[0]  # type: ignore[attr-defined, no-any-return]

    def too_near(self, point: NedPoint) -> str:
        return self._told[1]  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize(
    ("bounds", "reason"),
    [
        (_Fence(outside="the yard"), Reason(Refusal.BEYOND_BORDER, ("the yard",))),
        (_Fence(near="2 m away"), Reason(Refusal.NEAR_BORDER, ("2 m away",))),
    ],
)
def test_borders_refuse_by_name(tmp_path: Path, bounds: Bounds, reason: Reason[Refusal]) -> None:
    layout = replace(Asked(tmp_path).executor.layout, bounds=bounds)
    assert refusal(NEAR, NedPoint(0.0, 0.0), layout, 500.0) == reason


def test_known_and_seen_obstacles_refuse(tmp_path: Path) -> None:
    layout = Asked(tmp_path).executor.layout
    cell = layout.evidence.base.cell_at(NEAR)
    layout.evidence.grid.weights[cell.y, cell.x] = 1.0
    assert refusal(NEAR, NedPoint(0.0, 0.0), layout, 500.0) == Reason(Refusal.OBSTACLE_SEEN)
    layout.evidence.base.weights[cell.y, cell.x] = 1.0
    assert refusal(NEAR, NedPoint(0.0, 0.0), layout, 500.0) == Reason(Refusal.CLOSED)


def test_only_a_rover_that_is_driven_takes_requests(tmp_path: Path) -> None:
    waiting = Asked(tmp_path, begun=False)
    assert waiting.ask() is RequestAnswer.NOT_NOW and "not driving (connecting)" in waiting.notices.texts[-1]
    driven = Asked(tmp_path)
    driven.stand(0.0, 0.0, mode=RoverMode.HOLD)
    assert driven.ask() is RequestAnswer.NOT_NOW and "mode is not GUIDED" in driven.notices.texts[-1]
    driven.stand(0.0, 0.0, armed=False)
    assert driven.ask() is RequestAnswer.NOT_NOW
    driven.run.vehicle = replace(driven.stand(0.0, 0.0), position=None)
    assert driven.ask() is RequestAnswer.NOT_NOW and driven.notices.texts[-1].endswith("no position")


@pytest.mark.parametrize("phase", [MissionPhase.HOME, MissionPhase.DONE])
def test_on_the_way_back_and_after_the_end_nothing_is_accepted(tmp_path: Path, phase: MissionPhase) -> None:
    asked = Asked(tmp_path)
    asked.executor.progress = replace(asked.executor.progress, phase=phase)
    assert asked.ask() is RequestAnswer.NOT_NOW


def test_a_request_that_is_wrong_itself_is_answered_with_its_fault(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    assert asked.ask(None, fault=RequestAnswer.BAD_VALUE, reason="no place") is RequestAnswer.BAD_VALUE
    assert asked.notices.texts == ["Requested goal refused: no place"]


def test_the_same_refusal_is_counted_and_not_said_at_every_repetition(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    for _ in range(3):
        asked.clock.time_s += REFUSED_AGAIN_S + 0.1
        asked.stand(0.0, 0.0)
        asked.ask(NedPoint(-20.0, 0.0))
        asked.ask(NedPoint(-20.0, 0.0))
    texts = asked.notices.texts
    assert len(texts) == 3 and "(2 times)" in texts[1] and "(3 times)" in texts[2]


def test_a_flood_is_not_answered(tmp_path: Path) -> None:
    asked = Asked(tmp_path)
    for _ in range(MOST_A_SECOND):
        asked.ask()
    with pytest.raises(IndexError):
        asked.ask()
    asked.requests.take(EkfStatusSeen(10.0, 0), asked.run.vehicle)
    assert asked.autopilot.taken() == []
