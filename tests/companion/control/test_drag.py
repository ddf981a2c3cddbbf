"""How much a rover is held back, and how much farther it may shoot when the rough ground ends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.drag import DragWatch
from companion.control.local_view import MOST_FURTHER_M
from companion.core.frames import NedPoint, Pose
from companion.vehicle.commands import GuidedPosition
from tests.companion.control.test_safe_reach import ground, view

TICK_S = 0.05
FAR = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(6.0, 2.0)), 2.0)


def watched(watch: DragWatch, told: ControlCommand | None, speeds_m_s: Any, since_s: float = 0.0) -> float:
    """Ticks at a place four metres before the position; gives by how much the rover is held after the last."""
    held_m_s = 0.0
    for tick, speed_m_s in enumerate(speeds_m_s):
        pose = Pose(2.0, 2.0, 0.0, since_s + tick * TICK_S)
        held_m_s = watch.held_m_s(told, view(ground(), pose, speed_m_s=float(speed_m_s)))
    return held_m_s


@pytest.mark.parametrize(("dead_s", "gain_m_s2"), [(0.3, 0.8), (0.9, 0.6), (0.5, 1.5)])
def test_a_rover_that_gets_going_as_it_should_is_not_held(dead_s: float, gain_m_s2: float) -> None:
    speeds_m_s = [min(max(0.0, gain_m_s2 * (tick * TICK_S - dead_s)), 1.7) for tick in range(100)]
    assert watched(DragWatch(), FAR, speeds_m_s) == 0.0


def test_a_rover_that_does_not_set_off_is_held() -> None:
    assert watched(DragWatch(), FAR, [0.0] * 80) > 1.0


def test_a_rover_that_stays_slow_needs_room_for_the_speed_that_it_lacks() -> None:
    # ArduRover approaches a place 4 m away with 1.73 m/s at most; 0.3 m/s are slack.
    assert watched(DragWatch(), FAR, [0.7] * 80) == pytest.approx(1.73 - 0.7 - 0.3, abs=0.01)


def test_what_held_it_is_forgotten_slowly_once_it_does_as_told_and_not_before() -> None:
    watch = DragWatch()
    held_m_s = watched(watch, FAR, [0.7] * 80)
    slower = replace(FAR, speed_m_s=1.0)
    assert watched(watch, slower, [0.7] * 80, 4.0) == held_m_s
    assert 0.5 * held_m_s < watched(watch, slower, [1.0] * 20, 8.0) < 0.7 * held_m_s


def test_the_room_that_it_needs_has_an_end() -> None:
    held = replace(view(ground()), held_m_s=1.2)
    assert held.further_m == 1.2 and replace(held, held_m_s=5.0).further_m == MOST_FURTHER_M


def test_after_a_pause_it_gets_going_again() -> None:
    watch = DragWatch()
    assert watched(watch, FAR, [1.7] * 20) == 0.0
    assert watched(watch, FAR, [0.0, 0.0, 0.0], 30.0) == 0.0


@pytest.mark.parametrize(
    "told", [None, stop_for(Purpose.BRAKE), ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(2.0, 6.0)), 2.0)]
)
def test_a_rover_that_stands_or_turns_is_not_held(told: ControlCommand | None) -> None:
    assert watched(DragWatch(), told, [0.0] * 80) == 0.0
