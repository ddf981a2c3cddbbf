"""Faults that leave the data fresh: repeated readings, a late link, clocks that jump, work that takes too long."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from companion.navigation.step_runner import InlineRunner
from companion.safety.reasons import Doubt
from companion.settings import parse_settings
from sitl.sensors.range_sensors import Defect
from tests.support.quick import first_of
from tests.support.rig import HOLD, SET_MODE, Rig, without, yard
from tests.support.served import finished, mission_path, process, served, wait_until

TICK_S = 0.05


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A rover at full speed, with a wall ahead."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(3.0)
    return rig


def first_stop_s(rig: Rig, since_s: float) -> float:
    """When the first velocity of zero went out; a tick later all that was said has been taken note of."""
    rig.companion.tick()
    return next(one.time_s for one in rig.sent_since(since_s) if one.is_standstill)


def modes_asked_for(rig: Rig, since_s: float) -> list[float]:
    return [one.message.param2 for one in rig.sent_since(since_s) if one.command == SET_MODE]


class Repeated:
    """The lidar says again and again what it said when this began; its clock and its checksum are right."""

    def __init__(self) -> None:
        self._cells: Any = None

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "OBSTACLE_DISTANCE":
            self._cells = self._cells or list(message.distances)
            message.distances = self._cells
        return message


# --- heartbeats -----------------------------------------------------------------------------------------------------


def test_an_autopilot_whose_heartbeats_alone_are_missing(rig: Rig) -> None:
    rig.change, since_s = without("HEARTBEAT"), rig.now_s()
    rig.until(lambda: rig.gave(Doubt.DATA_OLD, "autopilot heartbeat"), 6.0)
    doubt_s = rig.now_s()
    assert 2.7 <= doubt_s - since_s <= 3.0 + 2 * TICK_S
    assert first_stop_s(rig, doubt_s - TICK_S) <= doubt_s + TICK_S
    rig.until(lambda: bool(modes_asked_for(rig, since_s)), 6.0)
    assert rig.now_s() - doubt_s == pytest.approx(2.0, abs=4 * TICK_S)
    rig.change = None
    rig.until(lambda: rig.mode == HOLD, 1.0)
    rig.run_for(3.0)
    assert modes_asked_for(rig, since_s) == [HOLD] and rig.simulator.collisions == ()


# --- range data that repeats itself ---------------------------------------------------------------------------------


def test_a_lidar_that_repeats_itself_stops_the_rover_and_lets_it_go_on_when_it_sees_again(rig: Rig) -> None:
    rig.change, since_s = Repeated(), rig.now_s()
    rig.run_for(1.8)
    assert first_stop_s(rig, since_s) - since_s <= 0.8
    assert rig.gave(Doubt.SCAN_REPEATED, "obstacle distance")
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert modes_asked_for(rig, since_s) == [HOLD], "only the one at the end"


def test_a_lidar_that_repeats_itself_for_ever_ends_in_hold_however_often_a_person_tries(rig: Rig) -> None:
    rig.change, since_s = Repeated(), rig.now_s()
    for _ in range(3):
        rig.until(lambda: rig.mode == HOLD, 5.0)
        rig.pilot_mode(15)
        rig.until(lambda: rig.mode == 15, 2.0)
    assert rig.simulator.collisions == ()
    assert rig.simulator.driven_m < 7.0
    assert modes_asked_for(rig, since_s) == [HOLD] * 3


# --- packets that come again and again --------------------------------------------------------------------------------


class Again:
    """In place of every message of a kind comes the first, with the boot time that it had then."""

    def __init__(self, *kinds: str) -> None:
        self._first: dict[str, Any] = {}
        self._kinds = kinds

    def __call__(self, message: Any) -> Any:
        kind = message.get_type()
        return self._first.setdefault(kind, message) if kind in self._kinds else message


@pytest.mark.parametrize("lost", [(), ("TIMESYNC",)])
@first_of(1, ("kind", "name"), [("ATTITUDE", "attitude"), ("LOCAL_POSITION_NED", "position")])
def test_a_packet_that_comes_again_and_again_is_as_old_as_its_boot_time(
    rig: Rig, kind: str, name: str, lost: tuple[str, ...]
) -> None:
    again, lose, since_s = Again(kind), without(*lost), rig.now_s()
    rig.change = lambda message: None if lose(message) is None else again(message)
    rig.until(lambda: rig.mode == HOLD, 3.5)
    assert first_stop_s(rig, since_s) - since_s <= 1.0 + 3 * TICK_S
    assert rig.gave(Doubt.DATA_OLD, name)
    assert modes_asked_for(rig, since_s) == [HOLD]


@first_of(1, "later_ticks", [0, 4])
def test_a_line_that_delivers_everything_twice_does_no_harm(rig: Rig, later_ticks: int) -> None:
    waiting = deque([b""] * later_ticks)

    def twice(data: bytes) -> bytes:
        waiting.append(data)
        return data + waiting.popleft()

    rig.garble, since_s = twice, rig.now_s()
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert not rig.was_stopped
    assert modes_asked_for(rig, since_s) == [HOLD], "only the one at the end"


# --- a late link ----------------------------------------------------------------------------------------------------


class Late:
    """Everything that the vehicle says comes so much later, in order."""

    def __init__(self, rig: Rig, late_s: float) -> None:
        self._rig, self.late_s = rig, late_s
        self._waiting: deque[tuple[float, bytes]] = deque()

    def __call__(self, data: bytes) -> bytes:
        now_s = self._rig.now_s()
        self._waiting.append((now_s + self.late_s, data))
        come = []
        while self._waiting and self._waiting[0][0] <= now_s + 1e-6:
            come.append(self._waiting.popleft()[1])
        return b"".join(come)


def test_a_good_link_is_a_tick_or_two_late(rig: Rig) -> None:
    rig.run_for(2.0)
    assert 0.0 < rig.companion.vehicle.latency_s <= 2 * TICK_S


@pytest.mark.parametrize("late_s", [0.3, 0.8])
def test_a_link_that_is_late_within_the_limit_is_measured_and_driven_on(rig: Rig, late_s: float) -> None:
    rig.garble, since_s = Late(rig, late_s), rig.now_s()
    rig.until(lambda: rig.companion.vehicle.latency_s >= late_s, 2 * late_s + 1.0)
    rig.run_for(2.0)
    assert late_s <= rig.companion.vehicle.latency_s <= late_s + 2 * TICK_S
    assert rig.now_s() - since_s > 2.0 and not rig.gave(Doubt.LINK_LATE)


def test_a_link_later_than_the_limit_stops_the_rover_and_holds_it_until_it_is_better_and_a_person_says_so(
    rig: Rig,
) -> None:
    late = Late(rig, 1.2)
    rig.garble, since_s = late, rig.now_s()
    rig.until(lambda: bool(modes_asked_for(rig, since_s)), 6.0)
    assert rig.gave(Doubt.LINK_LATE)
    assert first_stop_s(rig, since_s) - since_s <= 1.2 + 0.3, "nothing at all for 1 s, or three late reports"
    assert rig.now_s() - since_s <= 4.0
    late.late_s = 0.0
    rig.run_for(5.0)
    assert rig.mode == HOLD and rig.speed_m_s < 0.05
    rig.pilot_mode(15)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


# --- clocks that jump -----------------------------------------------------------------------------------------------


def clock_off_by(milliseconds: int) -> Callable[[Any], Any]:
    def change(message: Any) -> Any:
        if message.get_srcComponent() == 1 and "time_boot_ms" in message.get_fieldnames():
            message.time_boot_ms = max(0, message.time_boot_ms + milliseconds)
        return message

    return change


def test_an_autopilots_clock_that_jumps_ahead_stops_the_rover_for_a_moment(rig: Rig) -> None:
    rig.change, since_s = clock_off_by(60_000), rig.now_s()
    rig.until(lambda: rig.gave(Doubt.CLOCK_JUMPED), 1.0)
    assert first_stop_s(rig, since_s) - since_s <= 0.15 + TICK_S
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert modes_asked_for(rig, since_s) == [HOLD]


def test_an_autopilots_clock_that_runs_back_though_it_is_armed_and_in_guided_waits_for_a_person(rig: Rig) -> None:
    rig.change, since_s = clock_off_by(-40_000), rig.now_s()
    rig.until(lambda: rig.mode == HOLD, 4.0)
    assert first_stop_s(rig, since_s) - since_s <= 0.15 + TICK_S
    assert rig.gave(Doubt.AUTOPILOT_RESTARTED)
    rig.run_for(5.0)
    assert modes_asked_for(rig, since_s) == [HOLD] and rig.speed_m_s < 0.05
    rig.pilot_mode(15)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


# --- the companion's own work ---------------------------------------------------------------------------------------


def test_a_companion_that_is_too_slow_stops_the_rover_and_ends_in_hold(rig: Rig) -> None:
    since_s = rig.now_s()
    while rig.mode != HOLD:
        assert rig.now_s() < since_s + 6.0, rig.texts()
        rig.stall_s = 0.15
        rig.companion.tick()
    assert first_stop_s(rig, since_s) - since_s <= 2.7
    assert rig.gave(Doubt.LOOP_LATE)
    rig.run_for(5.0)
    assert modes_asked_for(rig, since_s) == [HOLD], "it does not go on by itself"
    rig.pilot_mode(15)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@first_of(1, ("done_after_s", "held"), [(1.0, False), (3.0, True)])
def test_a_step_that_does_not_end_stops_the_rover(
    tmp_path: Path, done_after_s: float, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(yard(tmp_path), parse_settings({"safety": {"planner_s": 2.0}}, "test"))
    rig.until_driven(3.0)
    since_s = rig.now_s()
    monkeypatch.setattr(InlineRunner, "working", True)
    rig.until(lambda: rig.gave(Doubt.PLANNING_LONG), 2.2)
    assert first_stop_s(rig, since_s) - since_s <= 2.0 + 2 * TICK_S
    rig.run_for(done_after_s)
    monkeypatch.setattr(InlineRunner, "working", False)
    rig.run_for(2.0)
    assert (rig.mode == HOLD) is held
    if held:
        rig.pilot_mode(15)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


# --- a position that wanders ----------------------------------------------------------------------------------------


class Wandering:
    """The position goes astray by so much a second, to and fro, and the velocity knows nothing of it."""

    def __init__(self, rig: Rig, rate_m_s: float, turn_back_s: float) -> None:
        self._rig, self._rate_m_s, self._turn_back_s, self._since_s = rig, rate_m_s, turn_back_s, rig.now_s()

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            at_s = (self._rig.now_s() - self._since_s) % (2.0 * self._turn_back_s)
            message.x += self._rate_m_s * min(at_s, 2.0 * self._turn_back_s - at_s)
        return message


def test_a_position_that_slides_away_once_makes_the_map_begin_anew(rig: Rig) -> None:
    rig.change, since_s = Wandering(rig, 0.8, 2.5), rig.now_s()
    rig.until(lambda: rig.gave(Doubt.POSITION_WANDERED), 3.0)
    assert rig.now_s() - since_s <= 1.1 / 0.8 + 0.1 + 2 * TICK_S
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_a_position_that_wanders_on_and_on_ends_in_hold(rig: Rig) -> None:
    rig.change, since_s = Wandering(rig, 0.6, 4.0), rig.now_s()
    rig.until(lambda: bool(modes_asked_for(rig, since_s)), 25.0)
    assert rig.gave(Doubt.POSITION_WANDERS)
    rig.until(lambda: rig.mode == HOLD, 1.0)
    assert rig.simulator.collisions == () and modes_asked_for(rig, since_s) == [HOLD]
    rig.change = None
    rig.run_for(15.0)
    assert rig.mode == HOLD


def test_a_position_that_drifts_as_slowly_as_they_all_do_is_driven_by(rig: Rig) -> None:
    rig.change = Wandering(rig, 0.04, 8.0)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert not rig.was_stopped


@pytest.mark.thorough
@pytest.mark.slow
def test_companion_and_simulator_as_two_processes_a_lidar_stuck_for_a_while(tmp_path: Path) -> None:
    """Over TCP, in real time: it stops, says why, drives on, and arrives."""
    mission = yard(tmp_path)
    with (
        served(mission) as world,
        process("companion", "run", mission_path(mission), "--connect", world.url, "--arm", watchdogs=True) as run,
    ):
        lines = iter(run.stderr.readline, "")
        wait_until(lambda: world.simulator.driven_m > 2.0)
        world.simulator._sensing.lidar_fault = Defect.STUCK
        assert any("Stopping: obstacle distance repeats itself" in line for line in lines)
        world.simulator._sensing.lidar_fault = None
        code, out, _ = finished(run)
        assert world.simulator.collisions == ()
    assert (code, out) == (0, "gate: reached\n")
