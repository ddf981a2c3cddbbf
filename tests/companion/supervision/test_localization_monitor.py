"""The position: jumps, an origin that moves, and a position that wanders."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import LocalFrame, NedPoint, Pose
from companion.safety.reasons import Doubt
from companion.settings import Settings
from companion.supervision.localization_monitor import (
    ANSWERED_S,
    ASK_PLACES_S,
    CALM_S,
    ONCE_S,
    SETTLED_S,
    UNSETTLED_S,
    WANDERINGS,
    LocalizationMonitor,
)
from companion.vehicle.dead_reckoning import Drift, drift_after
from companion.vehicle.events import (
    GpsSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
)
from companion.vehicle.gps_fix import GpsFix
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import PLACE, vehicle
from tests.support.desk import Desk

# The position ---------------------------------------------------------------------------------------------------------


class Located(Desk):
    """A monitor of the position of a mission under way."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder)
        link: Any = self.autopilot
        self.monitor = LocalizationMonitor(self.run, link, self.settings, self.notices)
        if begun:
            self.begin()

    def report(self, **state: Any) -> VehicleState:
        position = LocalPositionSeen(self.now_s, self.now_s, 0.0, 0.0, 0.0, 0.0)
        seen = replace(vehicle(self.now_s), position=position, **state)
        self.monitor.take(position, seen)
        return seen

    def hear_origin(self, by_m: float = 0.0, *, settled: bool = True) -> None:
        origin = LocalFrame(PLACE).to_geo(NedPoint(by_m, 0.0))
        self.monitor.take(OriginSeen(self.now_s, origin), replace(self.run.vehicle, wander=Drift(settled=settled)))
        self.see()

    def see(self) -> None:
        """A scan of now is taken into the map."""
        self.clock.time_s += 0.001
        seen = vehicle(self.now_s).scan_ahead
        assert seen is not None
        self.executor.map_scan(Pose(0.0, 0.0, 0.0, self.now_s), 0.0, seen.scan)
        self.report()

    @property
    def doubt(self) -> Doubt | None:
        found = self.monitor.doubt(self.now_s)
        return None if found is None else found.kind


def test_a_jump_is_doubted_until_the_origin_is_heard_again(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.report(jump_m=0.1)
    assert located.doubt is None and not located.monitor.position_doubted
    for _ in range(2):
        located.report(jump_m=5.0)
    assert located.doubt is Doubt.POSITION_JUMPED and len(located.notices.told) == 1
    located.monitor.tick(located.now_s)
    located.monitor.tick(located.now_s + ASK_PLACES_S / 2.0)
    assert located.autopilot.places_asked == 1
    located.hear_origin()
    assert located.doubt is Doubt.POSITION_JUMPED, "that answer may be older than the jump"
    located.clock.time_s += SETTLED_S + 0.01
    located.hear_origin()
    assert located.doubt is None and located.executor.maps_begun == 1


def test_how_far_a_jump_is_follows_the_settings(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.settings.replace(Settings.model_validate({"safety": {"jump_m": 8.0}}))
    located.report(jump_m=5.0)
    assert located.doubt is None


def test_an_origin_that_moves_is_doubted_until_the_next_answer(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.hear_origin(10.0)
    assert located.doubt is Doubt.ORIGIN_MOVED
    located.clock.time_s += SETTLED_S + 0.01
    located.hear_origin(10.0)
    assert located.doubt is None and located.executor.maps_begun == 2


def test_a_position_that_wanders_again_and_again_is_not_driven_by(tmp_path: Path) -> None:
    located = Located(tmp_path)
    for number in range(WANDERINGS):
        located.clock.time_s += ONCE_S + 0.1
        located.report(wander=Drift(off_m=2.0))
        assert located.doubt is (Doubt.POSITION_WANDERS if number == WANDERINGS - 1 else Doubt.POSITION_WANDERED)
        located.clock.time_s += SETTLED_S + 0.01
        located.hear_origin()
    assert located.doubt is Doubt.POSITION_WANDERS
    located.clock.time_s += CALM_S
    assert located.doubt is None


def test_a_position_that_wandered_is_waited_for_until_it_follows_its_velocity_but_not_for_ever(tmp_path: Path) -> None:
    located = Located(tmp_path)
    for settled, wait_s in ((True, SETTLED_S), (False, UNSETTLED_S)):
        located.report(wander=Drift(quick_m=2.0))
        assert located.doubt is Doubt.POSITION_WANDERED
        maps = located.executor.maps_begun
        located.clock.time_s += wait_s - 0.01
        located.hear_origin(settled=settled)
        assert located.doubt is (Doubt.POSITION_WANDERED if settled else Doubt.POSITION_SETTLES)
        assert located.monitor.position_doubted and located.executor.maps_begun == maps
        located.clock.time_s += 0.02
        located.hear_origin(settled=settled)
        assert located.doubt is None and located.executor.maps_begun == maps + 1


def test_a_rover_whose_map_was_forgotten_stands_until_something_ahead_is_on_it_again(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.report(jump_m=5.0)
    located.clock.time_s += SETTLED_S + 0.01
    located.monitor.take(OriginSeen(located.now_s, PLACE), vehicle(located.now_s - 0.1))
    located.clock.time_s += 0.1
    located.report()
    assert located.doubt is Doubt.MAP_EMPTY, "a scan came, but the rover turned too fast to map it"
    assert not located.monitor.position_doubted
    located.see()
    assert located.doubt is None


def test_while_it_settles_the_origin_must_be_heard_or_hold_follows(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.report(wander=Drift(quick_m=2.0))
    located.clock.time_s += SETTLED_S + 0.1
    located.hear_origin(settled=False)
    assert located.doubt is Doubt.POSITION_SETTLES
    located.clock.time_s += ANSWERED_S + 0.1
    assert located.doubt is Doubt.POSITION_WANDERED


@pytest.mark.parametrize("lead_s", [0.0, 0.2, 0.4])
def test_a_position_that_steps_before_the_receiver_tells_of_its_fix_moves_the_map(
    tmp_path: Path, lead_s: float
) -> None:
    """Again and again: it is no position that wanders."""
    located = Located(tmp_path)
    drift, before = Drift(), LocalPositionSeen(located.now_s, located.now_s, 0.0, 0.0, 0.0, 0.0)

    def go(seconds: float, fix: GpsFix, north_m: float) -> None:
        nonlocal drift, before
        for _ in range(round(seconds / 0.1)):
            located.clock.time_s += 0.1
            located.monitor.take(GpsSeen(located.now_s, fix, 10), located.run.vehicle)
            position = LocalPositionSeen(located.now_s, located.now_s, north_m, 0.0, 0.0, 0.0)
            drift, before = drift_after(drift, before, position), position
            located.monitor.take(position, replace(vehicle(located.now_s), position=position, wander=drift))

    go(4.0, GpsFix.RTK_FLOAT, 0.0)
    for fix, other, north_m in ((GpsFix.RTK_FLOAT, GpsFix.RTK_FIXED, 0.7), (GpsFix.RTK_FIXED, GpsFix.RTK_FLOAT, 0.0)):
        go(lead_s, fix, north_m)
        go(0.4, other, north_m)
        assert located.doubt is Doubt.FIX_CHANGED
        go(4.0, other, north_m)
        assert located.doubt is None
    assert [text for text in located.notices.told if "forgotten" in str(text)] == []
    assert located.executor.maps_begun == 2


def test_reports_that_are_missing_while_the_position_steps_with_the_fix_end_in_a_new_map(tmp_path: Path) -> None:
    """It must not stand there for ever: what became of the position meanwhile is not known."""
    located = Located(tmp_path)

    def go(seconds: float, fix: GpsFix, north_m: float) -> None:
        for _ in range(round(seconds / 0.1)):
            located.clock.time_s += 0.1
            located.monitor.take(GpsSeen(located.now_s, fix, 10), located.run.vehicle)
            position = LocalPositionSeen(located.now_s, located.now_s, north_m, 0.0, 0.0, 0.0)
            located.monitor.take(position, replace(vehicle(located.now_s), position=position))

    go(4.0, GpsFix.RTK_FLOAT, 0.0)
    go(0.5, GpsFix.RTK_FIXED, 0.5)
    assert located.doubt is Doubt.FIX_CHANGED
    located.clock.time_s += 1.5
    go(0.5, GpsFix.RTK_FIXED, 0.5)
    assert located.doubt is Doubt.POSITION_WANDERED
    located.clock.time_s += SETTLED_S + 0.01
    located.hear_origin()
    assert located.doubt is None and located.executor.maps_begun == 1


def test_before_the_mission_there_is_no_map_to_doubt_and_home_is_told_once(tmp_path: Path) -> None:
    located = Located(tmp_path, begun=False)
    located.report(jump_m=5.0)
    assert located.doubt is None and located.notices.told == []
    located.begin()
    away = LocalFrame(PLACE).to_geo(NedPoint(3.0, 0.0))
    for _ in range(2):
        located.monitor.take(HomeSeen(10.0, away), located.run.vehicle)
    assert len(located.notices.told) == 1 and located.doubt is None
