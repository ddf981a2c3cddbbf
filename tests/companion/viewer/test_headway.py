"""Whether a rover that is led gets on, and what is told where it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.core.frames import Pose
from companion.navigation.field_step import DecisionReason
from companion.safety.reasons import Activity, RunPhase
from companion.viewer.frame import news_of
from companion.viewer.headway import Headway, Hindrance

STEP_S = 0.1
TOLD = {
    Hindrance.STUCK: "stuck, looking for another way to gate",
    Hindrance.MAKES_WAY: "making way for something that moves, heading for gate",
    Hindrance.HARDLY: "hardly any progress, heading for gate",
}


def watched(
    seconds: float,
    north_m: Callable[[float], float],
    driver_at: Callable[[float], dict[str, Any]] = lambda _: {},
    phase: RunPhase = RunPhase.DRIVING,
) -> list[tuple[float, Hindrance | None]]:
    """When which hindrance began or ended, on a way to the gate; each that begins is told once."""
    headway, changes, told = Headway(), [(0.0, cast("Hindrance | None", None))], []
    for tick in range(round(seconds / STEP_S)):
        time_s = tick * STEP_S
        given = {"decision": "follow", "makes_way": False, "stuck": 0, **driver_at(time_s)}
        driver = SimpleNamespace(**given, tally=SimpleNamespace(stuck=given["stuck"]))
        pose = Pose(north_m(time_s), 0.0, 0.0, time_s)
        status = SimpleNamespace(
            time_s=time_s, pose=pose, activity=Activity(phase), target="gate", news=(), decision=None
        )
        vehicle = SimpleNamespace(forward_m_s=(north_m(time_s + STEP_S) - north_m(time_s)) / STEP_S)
        headway.note(cast(Any, SimpleNamespace(driver=driver, vehicle=vehicle)), cast(Any, status))
        told += [one["text"] for one in news_of(cast(Any, status), headway)]
        if headway.hindrance is not changes[-1][1]:
            changes.append((round(time_s, 1), headway.hindrance))
    assert told == [TOLD[one] for _, one in changes if one is not None]
    return changes[1:]


def test_a_rover_that_drives_slowly_gets_on() -> None:
    assert watched(60.0, lambda t: 0.1 * t) == []


def test_one_that_turns_or_goes_to_and_fro_in_one_place_does_not_get_on_until_it_has_left_it() -> None:
    assert watched(20.0, lambda t: max(0.0, t - 10.0)) == [(6.0, Hindrance.HARDLY), (10.3, None)]
    assert watched(20.0, lambda t: 0.4 * math.sin(t)) == [(12.0, Hindrance.HARDLY)]


def test_one_that_stands_because_something_moves_says_so() -> None:
    assert watched(8.0, lambda _: 0.0, lambda _: {"makes_way": True}) == [(3.0, Hindrance.MAKES_WAY)]


def test_one_that_stands_because_something_moves_is_not_said_to_drive() -> None:
    """At once, but for a stand of a moment; not one that rolls, or that stands for no other."""
    headway, doing = Headway(), []
    for tick in range(60):
        time_s, speed_m_s = tick * STEP_S, 0.4 if tick < 10 or tick >= 30 else 0.0
        driver = SimpleNamespace(decision="follow", makes_way=tick >= 5, tally=SimpleNamespace(stuck=0))
        vehicle = SimpleNamespace(forward_m_s=speed_m_s)
        status = moment(time_s, None)
        status.pose = Pose(0.0, 0.0, 0.0, time_s)
        headway.note(cast(Any, SimpleNamespace(driver=driver, vehicle=vehicle)), status)
        assert headway.stands_for_others == (15 <= tick < 30)
        doing.append(headway.doing("gate"))
    assert doing[14] == "" and set(doing[15:30]) == {TOLD[Hindrance.MAKES_WAY]}


def test_a_stuck_one_looks_for_another_way_until_there_is_one() -> None:
    def driver_at(time_s: float) -> dict[str, Any]:
        return {"stuck": int(time_s >= 3.0), "decision": None if 3.0 <= time_s < 5.0 else "follow"}

    assert watched(8.0, lambda _: 0.0, driver_at) == [(3.0, Hindrance.STUCK), (5.0, None)]


def test_one_that_is_not_to_drive_is_not_held_up() -> None:
    assert watched(20.0, lambda _: 0.0, phase=RunPhase.WAY_BLOCKED) == []


def moment(time_s: float, decision: Any, target: str = "gate", phase: RunPhase = RunPhase.DRIVING) -> Any:
    return SimpleNamespace(time_s=time_s, pose=None, activity=Activity(phase), decision=decision, target=target)


@pytest.mark.parametrize("changed", [{"target": "shed"}, {"phase": RunPhase.STOPPED}])
def test_why_it_took_another_way_is_not_why_it_goes_elsewhere_or_on_after_a_stop(changed: dict[str, Any]) -> None:
    better, following = (
        SimpleNamespace(reason=reason) for reason in (DecisionReason.BETTER_PATH, DecisionReason.FOLLOWING)
    )
    headway, companion = Headway(), cast(Any, SimpleNamespace(driver=None))
    headway.note(companion, moment(0.0, following))
    headway.note(companion, moment(0.1, better))
    assert headway.rerouted == "a better path"
    headway.note(companion, moment(0.2, following, **changed))
    assert headway.rerouted == ""
    headway.note(companion, moment(0.3, following))
    assert headway.rerouted == ""


def test_why_it_took_another_way_is_told_for_some_seconds() -> None:
    following, blocked = (
        SimpleNamespace(reason=reason) for reason in (DecisionReason.FOLLOWING, DecisionReason.PATH_BLOCKED)
    )
    headway, told = Headway(), []
    for tick in range(120):
        time_s = tick * STEP_S
        decision = blocked if 30 <= tick < 35 else following
        status = moment(time_s, decision)
        headway.note(cast(Any, SimpleNamespace(driver=None)), cast(Any, status))
        told.append(headway.rerouted)
    assert told[29] == "" and set(told[30:80]) == {"current path blocked: new path"} and set(told[82:]) == {""}
