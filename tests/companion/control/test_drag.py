"""How much a rover is held back, and how much farther it may shoot when the rough ground ends."""

from __future__ import annotations

from typing import Any

import pytest

from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.drag import MOST_M, DragWatch
from companion.core.frames import NedPoint, Pose
from companion.vehicle.commands import GuidedPosition
from tests.companion.control.test_safe_reach import ground, view

TICK_S = 0.05
FAR = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(6.0, 2.0)), 2.0)


def watched(watch: DragWatch, told: ControlCommand | None, speeds_m_s: Any, since_s: float = 0.0) -> float:
    """Ticks at a place four metres before the position; gives the room for overshoot after the last."""
    further_m = 0.0
    for tick, speed_m_s in enumerate(speeds_m_s):
        pose = Pose(2.0, 2.0, 0.0, since_s + tick * TICK_S)
        watch.tell(told)
        further_m = watch.overshoot_m(view(ground(), pose, speed_m_s=float(speed_m_s)))
    return further_m


@pytest.mark.parametrize(("dead_s", "gain_m_s2"), [(0.3, 0.8), (0.9, 0.6), (0.5, 1.5)])
def test_a_rover_that_gets_going_as_it_should_is_not_held(dead_s: float, gain_m_s2: float) -> None:
    speeds_m_s = [min(max(0.0, gain_m_s2 * (tick * TICK_S - dead_s)), 1.7) for tick in range(100)]
    assert watched(DragWatch(), FAR, speeds_m_s) == 0.0


def test_a_rover_that_does_not_set_off_is_held() -> None:
    assert watched(DragWatch(), FAR, [0.0] * 80) > 1.0


def test_a_rover_that_stays_slow_needs_room_for_the_speed_that_it_lacks() -> None:
    # ArduRover approaches a place 4 m away with 1.73 m/s at most; 0.3 m/s are slack.
    assert watched(DragWatch(), FAR, [0.7] * 80) == pytest.approx(1.73 - 0.7 - 0.3, abs=0.01)


def test_it_is_never_more_than_that() -> None:
    fast = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(60.0, 2.0)), 6.0)
    assert watched(DragWatch(), fast, [0.3] * 300) == MOST_M


def test_what_held_it_is_forgotten_slowly() -> None:
    watch = DragWatch()
    held_m = watched(watch, FAR, [0.7] * 80)
    assert 0.5 * held_m < watched(watch, FAR, [1.7] * 20, 4.0) < 0.7 * held_m


def test_after_a_pause_it_gets_going_again() -> None:
    watch = DragWatch()
    assert watched(watch, FAR, [1.7] * 20) == 0.0
    assert watched(watch, FAR, [0.0, 0.0, 0.0], 30.0) == 0.0


@pytest.mark.parametrize(
    "told", [None, stop_for(Purpose.BRAKE), ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(2.0, 6.0)), 2.0)]
)
def test_a_rover_that_stands_or_turns_is_not_held(told: ControlCommand | None) -> None:
    assert watched(DragWatch(), told, [0.0] * 80) == 0.0
