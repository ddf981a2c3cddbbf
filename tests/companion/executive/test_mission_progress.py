"""Which target is next: the table of states."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.core.frames import NedPoint
from companion.core.grid import Cell
from companion.executive.mission_progress import (
    MissionPhase,
    MissionProgress,
    TargetStatus,
    on_reached,
    on_time,
    on_unreachable,
    plan_progress,
    with_requested,
)
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget

REACHED, UNREACHABLE = TargetStatus.REACHED, TargetStatus.UNREACHABLE
SKIPPED, PENDING = TargetStatus.SKIPPED, TargetStatus.PENDING


def target(name: str, on_blocked: OnBlocked = OnBlocked.SKIP, hold_s: float = 0.0) -> ResolvedTarget:
    return ResolvedTarget(name, NedPoint(0.0, 0.0), Cell(0, 0), hold_s, on_blocked, None)


def progress(on_blocked: OnBlocked = OnBlocked.SKIP) -> MissionProgress:
    return plan_progress((target("a", on_blocked, 3.0), target("b"), target("c")), target("start"))


def blocked(state: MissionProgress, now_s: float = 10.0) -> MissionProgress:
    return on_unreachable(state, now_s, retry_s=5.0, wait_limit_s=12.0)


def test_targets_come_in_order_each_with_its_stay():
    state = progress()
    assert state.goal.name == "a" and state.phase is MissionPhase.TRAVEL
    state = on_reached(state, 100.0)
    assert (state.phase, state.until_s, state.statuses) == (MissionPhase.STAY, 103.0, (REACHED, PENDING, PENDING))
    assert on_time(state, 102.9) is state
    state = on_time(state, 103.0)
    assert state.phase is MissionPhase.TRAVEL and state.goal.name == "b"
    for now_s in (110.0, 120.0):
        state = on_time(on_reached(state, now_s), now_s)
    assert state.phase is MissionPhase.DONE and state.statuses == (REACHED,) * 3


@pytest.mark.parametrize(
    ("on_blocked", "phase", "goal", "statuses"),
    [
        (OnBlocked.SKIP, MissionPhase.TRAVEL, "b", (UNREACHABLE, PENDING, PENDING)),
        (OnBlocked.WAIT, MissionPhase.WAIT, "a", (UNREACHABLE, PENDING, PENDING)),
        (OnBlocked.RETURN, MissionPhase.HOME, "start", (UNREACHABLE, SKIPPED, SKIPPED)),
        (OnBlocked.HOLD, MissionPhase.HOLD, "a", (UNREACHABLE, SKIPPED, SKIPPED)),
    ],
)
def test_on_blocked_decides(on_blocked, phase, goal, statuses):
    state = blocked(progress(on_blocked))
    assert (state.phase, state.goal.name, state.statuses) == (phase, goal, statuses)


def test_skipping_the_last_target_ends_the_mission():
    state = replace(progress(), index=2, statuses=(REACHED, REACHED, PENDING))
    state = blocked(state)
    assert state.phase is MissionPhase.DONE and state.statuses == (REACHED, REACHED, UNREACHABLE)


def test_waiting_tries_again_and_gives_up_at_its_limit():
    state = blocked(progress(OnBlocked.WAIT), now_s=10.0)
    tries = 1
    for now_s in (12.0, 15.0, 20.0):
        state = on_time(state, now_s)
        if state.phase is MissionPhase.TRAVEL:
            tries += 1
            state = blocked(state, now_s)
    assert tries == 3 and state.phase is MissionPhase.WAIT, "given up only 12 s after the first time"
    state = blocked(on_time(state, 25.0), 25.0)
    assert state.phase is MissionPhase.TRAVEL and state.goal.name == "b" and state.give_up_s is None


def test_a_target_reached_after_waiting_counts_as_reached():
    state = on_reached(on_time(blocked(progress(OnBlocked.WAIT)), 15.0), 20.0)
    assert state.statuses[0] is REACHED and state.give_up_s is None


def test_home_reached_ends_the_mission_and_home_unreachable_holds():
    state = blocked(progress(OnBlocked.RETURN))
    assert on_reached(state, 50.0).phase is MissionPhase.DONE
    assert blocked(state).phase is MissionPhase.HOLD
    assert on_reached(state, 50.0).statuses == state.statuses, "home is no target"


@pytest.mark.parametrize("phase", [MissionPhase.TRAVEL, MissionPhase.HOME, MissionPhase.HOLD, MissionPhase.DONE])
def test_time_alone_changes_nothing_else(phase):
    state = replace(progress(), phase=phase)
    assert on_time(state, 1e9) is state


def test_a_requested_goal_comes_first_and_then_the_same_target():
    state = with_requested(progress(), target("requested goal"))
    assert state.goal.name == "requested goal" and not state.ended
    for after in (on_reached(state, 5.0), blocked(state)):
        assert after == progress()


def test_a_stay_that_a_requested_goal_interrupts_is_over():
    state = with_requested(on_reached(progress(), 100.0), target("requested goal"))
    assert on_time(state, 100.5) is state
    state = on_reached(state, 101.0)
    assert (state.phase, state.goal.name, state.statuses) == (MissionPhase.TRAVEL, "b", (REACHED, PENDING, PENDING))


def test_a_requested_goal_while_waiting_at_the_last_target_comes_before_the_end():
    state = progress()
    for now_s in (10.0, 20.0):
        state = on_time(on_reached(state, now_s), now_s + 3.0)
    state = with_requested(on_reached(state, 30.0), target("requested goal"))
    assert state.phase is MissionPhase.DONE and not state.ended
    assert on_reached(state, 40.0).ended


def test_a_wait_that_a_requested_goal_interrupts_is_another_try_and_keeps_its_limit():
    state = with_requested(blocked(progress(OnBlocked.WAIT), 10.0), target("requested goal"))
    state = on_reached(state, 20.0)
    assert (state.phase, state.goal.name, state.give_up_s) == (MissionPhase.TRAVEL, "a", 22.0)
    assert blocked(state, 22.0).goal.name == "b"


def test_a_newer_requested_goal_takes_the_place_of_one_under_way():
    state = with_requested(with_requested(progress(), target("first")), target("second"))
    assert on_reached(state, 5.0) == progress()
