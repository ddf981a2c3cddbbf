"""The companion watches its own work: what is a hiccup, and what is too slow."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import pytest

from companion.navigation.step_runner import ThreadRunner
from companion.safety.loop_watch import LATE_S, LATE_SHARE, WINDOW_S, LoopWatch

TICK_S = 0.05


def noticed_s(took_s: Callable[[int], float], ticks: int = 2000) -> float:
    """When a loop is noticed whose ``i``-th tick takes so long; inf: never. It catches up, and gives up what is a second late."""
    watch, now_s, next_s = LoopWatch(30.0), 0.0, 0.0
    for i in range(ticks):
        next_s += TICK_S
        now_s = max(now_s, next_s)
        watch.tick(now_s, now_s - next_s, planner_works=False)
        if watch.reason:
            return now_s
        if now_s - next_s > 1.0:
            next_s = now_s
        now_s += took_s(i)
    return math.inf


@pytest.mark.parametrize(
    ("took_s", "noticed"),
    [
        (lambda i: 0.001, False),
        (lambda i: 0.049, False),
        (lambda i: 0.9 if i == 500 else 0.001, False),
        (lambda i: 0.9 if i in (500, 510) else 0.001, False),
        (lambda i: 0.3 if i % 40 == 0 else 0.001, False),
        (lambda i: 0.9 if i % 20 == 0 else 0.001, True),
        (lambda i: 0.06, True),
        (lambda i: 0.15, True),
        (lambda i: 0.8, True),
    ],
)
def test_late_again_and_again_is_told_from_a_hiccup(took_s: Callable[[int], float], noticed: bool):
    assert math.isfinite(noticed_s(took_s)) is noticed


@pytest.mark.parametrize("took_s", [0.15, 0.3, 0.8])
def test_a_loop_that_is_three_times_too_slow_is_noticed_within_the_window(took_s: float):
    assert noticed_s(lambda _: took_s) <= LATE_SHARE * WINDOW_S + LATE_S + 3 * took_s


def test_a_loop_that_is_in_time_again_is_believed_again():
    watch = LoopWatch(30.0)
    for i in range(40):
        watch.tick(0.1 * i, 0.15, planner_works=False)
    assert watch.reason == "the companion is too slow"
    for i in range(60):
        watch.tick(4.0 + TICK_S * i, 0.0, planner_works=False)
    assert not watch.reason


def test_a_step_that_does_not_end_is_noticed_and_ends():
    watch = LoopWatch(3.0)
    reasons = []
    for i in range(200):
        watch.tick(TICK_S * i, 0.0, planner_works=20 <= i < 100 or i >= 190)
        reasons.append(watch.reason)
    told = [i for i, reason in enumerate(reasons) if reason]
    assert told == list(range(81, 100)) and reasons[81] == "planning has taken over 3 s"


def test_the_thread_says_whether_it_works():
    runner, go_on = ThreadRunner(), threading.Event()
    try:
        assert not runner.working
        runner.start(lambda: (go_on.wait(10.0), None))  # type: ignore[arg-type, return-value]
        assert runner.working and runner.busy
        go_on.set()
        result = None
        while result is None:
            result = runner.take()
        assert not runner.working and not runner.busy
    finally:
        go_on.set()
        runner.close()
