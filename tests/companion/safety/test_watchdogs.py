"""The watchdogs: the companion's own loop, the age of data, repeated scans, and who is heard first."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from companion.core.scan import RangeScan
from companion.navigation.step_runner import ThreadRunner
from companion.safety.reasons import Doubt, Reason
from companion.safety.watchdogs import (
    LATE_S,
    LATE_SHARE,
    SETTLE_S,
    WINDOW_S,
    DataMonitor,
    LoopMonitor,
    Monitor,
    ScanMonitor,
    SticksMonitor,
    data_doubt,
    first_doubt,
)
from companion.settings import SafetySettings, Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import (
    EkfStatusSeen,
    LocalPositionSeen,
    RangeSeen,
)
from companion.vehicle.link_latency import Latency
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import doubt_of, vehicle

TICK_S = 0.05


class Loop:
    """A loop that is as late as it is told to be, and a step that is under way or not."""

    late_s = 0.0
    working = False

    def monitor(self, planner_s: float = 30.0) -> LoopMonitor:
        return LoopMonitor(self, self, planner_s)


def noticed_s(took_s: Callable[[int], float], ticks: int = 2000) -> float:
    """When a loop is noticed whose ``i``-th tick takes ``took_s(i)``; inf: never. What is a second late is given up."""
    loop, now_s, next_s = Loop(), 0.0, 0.0
    watch = loop.monitor()
    for i in range(ticks):
        next_s += TICK_S
        now_s = max(now_s, next_s)
        loop.late_s = now_s - next_s
        watch.tick(now_s)
        if watch.doubt(now_s) == Reason(Doubt.LOOP_LATE):
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
    loop = Loop()
    watch = loop.monitor()
    assert ticked(loop, watch, [(0.1 * i, 0.15) for i in range(40)])[-1] == Reason(Doubt.LOOP_LATE)
    assert ticked(loop, watch, [(4.0 + TICK_S * i, 0.0) for i in range(60)])[-1] is None


def ticked(loop: Loop, watch: LoopMonitor, ticks: list[tuple[float, float]]) -> list[Reason[Doubt] | None]:
    """What it says after each tick (when, how late)."""
    told = []
    for now_s, loop.late_s in ticks:
        watch.tick(now_s)
        told.append(watch.doubt(now_s))
    return told


def test_late_for_more_than_two_of_the_last_four_seconds_is_too_slow():
    """The first tick has no time before it; of a tick that is late all the time since the one before it counts."""
    loop = Loop()
    watch = loop.monitor()
    assert watch.doubt(100.0) is None
    slow = ticked(loop, watch, [(100.0 + 0.125 * i, 0.125) for i in range(18)])
    assert slow == [None] * 17 + [Reason(Doubt.LOOP_LATE)]
    again = ticked(loop, watch, [(102.125 + 0.125 * i, 0.0) for i in range(1, 18)])
    assert again == [Reason(Doubt.LOOP_LATE)] * 16 + [None]


@pytest.mark.parametrize(("late_s", "slow"), [(0.1, False), (0.105, True)])
def test_up_to_a_tenth_of_a_second_is_not_late(late_s: float, slow: bool):
    loop = Loop()
    told = ticked(loop, loop.monitor(), [(0.125 * i, late_s) for i in range(40)])
    assert (told[-1] is not None) is slow


def test_a_stall_counts_for_a_second_however_long_it_was():
    loop = Loop()
    watch = loop.monitor()
    ticked(loop, watch, [(1.25 * i, 9.0) for i in range(3)])
    assert watch.doubt(2.5 + SETTLE_S) is None, "two seconds"
    ticked(loop, watch, [(3.75, 9.0)])
    assert watch.doubt(3.75 + SETTLE_S) == Reason(Doubt.LOOP_LATE)


@pytest.mark.parametrize(("late_s", "stood"), [(1.0, False), (1.05, True)])
def test_after_a_stall_the_rover_waits_until_what_piled_up_has_passed(late_s: float, stood: bool):
    loop = Loop()
    watch = loop.monitor()
    ticked(loop, watch, [(10.0, 0.0), (11.0, late_s), (11.05, 0.0)])
    waits = Reason(Doubt.LOOP_STOOD_STILL) if stood else None
    assert [watch.doubt(11.0 + after_s) for after_s in (0.0, 0.39, 0.4)] == [waits, waits, None]


def test_a_step_that_is_under_way_at_the_first_tick_has_just_begun():
    loop = Loop()
    loop.working, watch = True, loop.monitor(3.0)
    for now_s, long in ((100.0, False), (103.0, False), (103.1, True)):
        watch.tick(now_s)
        assert watch.doubt(now_s) == (Reason(Doubt.PLANNING_LONG, (3.0,)) if long else None)


def test_a_step_that_does_not_end_is_noticed_and_ends():
    loop = Loop()
    watch, doubts = loop.monitor(3.0), []
    for i in range(200):
        loop.working = 20 <= i < 100 or i >= 190
        watch.tick(TICK_S * i)
        doubts.append(watch.doubt(TICK_S * i))
    told = [i for i, doubt in enumerate(doubts) if doubt is not None]
    assert told == list(range(81, 100)) and doubts[81] == Reason(Doubt.PLANNING_LONG, (3.0,))


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


# The order of precedence, and the data ------------------------------------------------------------------------------

SETTINGS = SafetySettings()


class Always(Monitor):
    """A monitor with one doubt."""

    def __init__(self, doubt: Doubt | None) -> None:
        self._doubt = doubt

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        return None if self._doubt is None else Reason(self._doubt)


def test_the_first_monitor_that_doubts_is_heard():
    quiet, jumped, late = Always(None), Always(Doubt.POSITION_JUMPED), Always(Doubt.LOOP_LATE)
    assert first_doubt((), 0.0) is None and first_doubt((quiet,), 0.0) is None
    assert first_doubt((quiet, jumped, late), 0.0) == Reason(Doubt.POSITION_JUMPED)
    assert first_doubt((late, jumped), 0.0) == Reason(Doubt.LOOP_LATE)


def test_sticks_are_doubted_from_the_event_that_moved_them():
    sticks = SticksMonitor()
    assert sticks.doubt(0.0) is None
    sticks.take(EkfStatusSeen(0.0, 0), replace(vehicle(), sticks=Sticks((1500, 1500), 9)))
    assert sticks.doubt(0.0) == Reason(Doubt.STICKS_MOVED)
    sticks.take(EkfStatusSeen(0.0, 0), vehicle())
    assert sticks.doubt(0.0) is None


def test_what_is_missing_is_named_one_after_the_other():
    monitor, seen = DataMonitor(LiveSettings(Settings())), VehicleState()
    assert monitor.doubt(10.0) == Reason(Doubt.DATA_MISSING, ("autopilot heartbeat",)), "nothing was heard"
    named = []
    for name in ("heartbeat", "position", "attitude", "scan_ahead", "ekf"):
        seen = replace(seen, **{name: getattr(vehicle(10.0), name)})
        monitor.take(EkfStatusSeen(10.0, 0), seen)
        named.append(monitor.doubt(10.0))
    words = ("position", "attitude", "range data ahead", "EKF status")
    assert named == [*(Reason(Doubt.DATA_MISSING, (word,)) for word in words), None]


@pytest.mark.parametrize("name", ["heartbeat", "position", "attitude", "scan_ahead", "ekf"])
def test_what_is_missing_or_old_is_doubted(name: str):
    good = vehicle(10.0)
    assert doubt_of(good, 10.9) is None
    assert doubt_of(replace(good, **{name: None}), 10.0) is Doubt.DATA_MISSING
    limit_s = SETTINGS.heartbeat_s if name == "heartbeat" else SETTINGS.stale_s
    fresh = vehicle(20.0)
    old = replace(fresh, **{name: getattr(vehicle(20.0 - limit_s - 0.1), name)})
    assert doubt_of(old, 20.0) is Doubt.DATA_OLD
    assert doubt_of(replace(fresh, **{name: getattr(vehicle(20.0 - limit_s), name)}), 20.0) is None


@pytest.mark.parametrize(
    ("flags", "ok"), [(831, True), (3 | 8, True), (3 | 16, True), (7, False), (831 | 128, False), (0, False)]
)
def test_the_ekf_must_have_a_position(flags: int, ok: bool):
    assert doubt_of(vehicle(ekf=flags), 10.0) is (None if ok else Doubt.EKF_INCOMPLETE)


def test_after_a_jump_of_the_autopilots_clock_the_rover_stands_for_a_while():
    seen = replace(vehicle(10.0), latency=Latency(jumped_s=9.75))
    settings = SETTINGS.model_copy(update={"settle_s": 0.5})
    assert data_doubt(seen, 10.0, settings) == Reason(Doubt.CLOCK_JUMPED)
    assert data_doubt(seen, 10.25, settings) is None


@pytest.mark.parametrize(
    ("round_trips_s", "late"), [((1.0, 1.0, 1.0), False), ((1.1, 1.1, 1.1), True), ((9.0,), False)]
)
def test_a_link_that_is_late_again_and_again_is_doubted(round_trips_s: tuple[float, ...], late: bool):
    seen = replace(vehicle(10.0), latency=Latency(round_trips_s=round_trips_s))
    settings = SETTINGS.model_copy(update={"latency_s": 1.0})
    assert data_doubt(seen, 10.0, settings) == (Reason(Doubt.LINK_LATE, (1.0,)) if late else None)


def test_contradictions_are_doubted_after_the_age_of_the_data():
    assert doubt_of(replace(vehicle(), restarted=True, frozen=True), 10.0) is Doubt.AUTOPILOT_RESTARTED
    assert doubt_of(replace(vehicle(), frozen=True), 10.0) is Doubt.POSITION_FROZEN
    assert doubt_of(replace(vehicle(), frozen=True), 20.0) is Doubt.DATA_OLD


def test_settings_that_are_replaced_count_at_once():
    live = LiveSettings(Settings())
    monitor = DataMonitor(live)
    monitor.take(EkfStatusSeen(10.0, 0), vehicle(10.0))
    assert monitor.doubt(10.9) is None
    live.replace(Settings.model_validate({"safety": {"stale_s": 0.5}}))
    assert monitor.doubt(10.9) == Reason(Doubt.DATA_OLD, ("position", 0.5))


def test_scans_are_doubted_by_the_name_of_their_sensor():
    scans, moving = ScanMonitor(), replace(vehicle(), position=LocalPositionSeen(0.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    seen = RangeScan(0.0, np.linspace(-0.5, 0.5, 9), np.linspace(2.0, 5.0, 9), 0.1, 8.0, 0.1, "lidar")
    fits = [scans.fits]
    assert scans.doubt(0.0) is None
    for tick in range(20):
        scans.take(RangeSeen(0.1 * tick, replace(seen, time_s=0.1 * tick)), moving)
        fits.append(scans.fits)
    assert fits[0] and fits[1] and not fits[-1]
    assert scans.doubt(2.0) == Reason(Doubt.SCAN_REPEATED, ("lidar",))
    scans.take(EkfStatusSeen(2.0, 0), moving)
    assert not scans.fits, "only a scan changes that"
