"""How much a rover is held back, and how much farther it may shoot when the ground that holds it ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.control.controller import ControlCommand, Purpose
from companion.control.drag import (
    BACK_M_S,
    CLOSES_S,
    DRAGS_S,
    FORGOTTEN_S,
    SLACK_M_S,
    STALE_S,
    DragWatch,
    braked_harder,
)
from companion.control.local_view import MOST_FURTHER_M, LocalView
from companion.core.frames import Pose
from companion.mission.bounds import Bounds
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from companion.vehicle.events import ThrottleSeen
from companion.vehicle.motion_limits import full_throttle_m_s
from tests.companion.control.test_safe_reach import HERE, SETTINGS, ground, put, view

FULL_M_S = 4.0


def held_m_s(watch: DragWatch, share: float, speed_m_s: float, now_s: float = 0.0, age_s: float = 0.0) -> float:
    moment = view(ground(), Pose(2.0, 2.0, 0.0, now_s), speed_m_s)
    return watch.held_m_s(ThrottleSeen(now_s - age_s, share), FULL_M_S, moment)


@pytest.mark.parametrize("speed_m_s", [0.0, 0.5, 2.0, 4.0])
def test_on_firm_ground_it_goes_as_its_throttle_says(speed_m_s: float) -> None:
    assert held_m_s(DragWatch(), speed_m_s / FULL_M_S, speed_m_s) == 0.0
    assert held_m_s(DragWatch(), 0.1, 1.0) == 0.0


@pytest.mark.parametrize(("share", "speed_m_s"), [(0.6, 0.48), (1.0, 0.0), (0.25, 0.2)])
def test_a_slower_one_is_held_by_what_it_lacks(share: float, speed_m_s: float) -> None:
    assert held_m_s(DragWatch(), share, speed_m_s) == pytest.approx(share * FULL_M_S - speed_m_s - SLACK_M_S)


def test_it_is_forgotten_soon_but_not_at_once() -> None:
    watch = DragWatch()
    before = held_m_s(watch, 0.5, 0.3)
    assert held_m_s(watch, 0.0, 0.3, FORGOTTEN_S) == pytest.approx(before * math.exp(-1.0))
    assert held_m_s(watch, 0.0, 0.3, 60.0) == pytest.approx(0.0, abs=1e-9)


def test_without_a_throttle_nothing_is_known() -> None:
    assert DragWatch().held_m_s(None, FULL_M_S, view(ground())) == 0.0
    assert held_m_s(DragWatch(), 1.0, 0.0, 10.0, STALE_S) == 0.0


def test_the_room_that_it_needs_has_an_end() -> None:
    held = replace(view(ground()), held_m_s=1.2)
    assert held.further_m == pytest.approx(SETTINGS.guidance.held_overshoot_s * 1.2)
    assert replace(held, held_m_s=5.0).further_m == MOST_FURTHER_M


def test_the_autopilot_tells_how_fast_it_goes_with_full_throttle() -> None:
    assert full_throttle_m_s({"CRUISE_SPEED": 3.0, "CRUISE_THROTTLE": 75.0}) == pytest.approx(4.0)
    assert full_throttle_m_s({"CRUISE_SPEED": 1.0, "CRUISE_THROTTLE": 40.0}) == pytest.approx(2.5)


@pytest.mark.parametrize("known", [{}, {"CRUISE_SPEED": 1.0}, {"CRUISE_SPEED": 1.0, "CRUISE_THROTTLE": 0.0}])
def test_or_it_is_as_shipped(known: dict[str, float]) -> None:
    assert full_throttle_m_s(known) == pytest.approx(4.0)


STAND = ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, 0.0), 0.0)


def held_back() -> LocalView:
    return replace(view(ground(), HERE, 0.3), held_m_s=1.0, lately_held=True)


def test_a_rover_that_is_held_and_rolls_on_is_told_to_roll_back_until_it_stands() -> None:
    held = held_back()
    back = braked_harder(STAND, held, Bounds())
    assert back.purpose is Purpose.BRAKE
    assert isinstance(back.setpoint, GuidedVelocity) and back.setpoint == GuidedVelocity(-BACK_M_S[0], 0.0)
    assert braked_harder(STAND, replace(held, lately_held=False), Bounds()) == STAND
    turns = ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, 0.5), 0.0)
    assert braked_harder(turns, held, Bounds()).setpoint == GuidedVelocity(-BACK_M_S[0], 0.5)
    for stands in (replace(held, speed_m_s=0.05), replace(held, rolls_back=True)):
        assert braked_harder(STAND, stands, Bounds()) == STAND


def test_the_throttle_may_still_be_open_for_a_while_after_the_ground_has_let_it_go() -> None:
    watch = DragWatch()
    held_m_s(watch, 0.1, 1.0)
    assert not watch.closes()
    held_m_s(watch, 0.5, 0.5, 1.0)
    assert watch.closes()
    held_m_s(watch, 0.2, 1.0, 0.9 + CLOSES_S)
    assert watch.closes()
    held_m_s(watch, 0.2, 1.0, 4.0 + CLOSES_S)
    assert not watch.closes()


def test_any_other_command_stays_as_it_is() -> None:
    for setpoint in (
        GuidedVelocity(0.5, 0.0),
        GuidedVelocity(0.0, 0.4),
        GuidedPosition(HERE.point),
        GuidedHeading(1.0),
    ):
        command = ControlCommand(Purpose.DRIVE, setpoint, 1.0)
        assert braked_harder(command, held_back(), Bounds()) == command


@pytest.mark.parametrize(("wall_m", "back_m_s"), [(7.0, 1.0), (3.5, 0.5), (2.0, 0.25), (0.6, 0.0)])
def test_it_is_told_no_more_than_it_may_be_left_alone_with(wall_m: float, back_m_s: float) -> None:
    """A wall so far behind it."""
    map_ = ground()
    pose = Pose(8.0, 10.0, 0.0, 0.0)
    for east_m in np.arange(8.0, 12.0, 0.2):
        put(map_, pose.north_m - wall_m, float(east_m))
    held = replace(view(map_, pose, 0.3), held_m_s=1.0, lately_held=True)
    assert braked_harder(STAND, held, Bounds()).setpoint == GuidedVelocity(-back_m_s, 0.0)


def test_ground_drags_only_a_rover_that_is_held_much_and_for_long() -> None:
    def dragged_m_s(share: float, speed_m_s: float, seconds: float) -> float:
        watch = DragWatch()
        for tick in range(round(seconds / 0.05) + 1):
            held_m_s(watch, share, speed_m_s, 0.05 * tick)
        return watch.dragged_m_s()

    gravel = 1.0 * FULL_M_S - 0.8 - SLACK_M_S
    assert dragged_m_s(1.0, 0.8, DRAGS_S + 0.1) == pytest.approx(gravel)
    assert dragged_m_s(1.0, 0.8, DRAGS_S - 0.2) == 0.0, "it may gather speed"
    assert dragged_m_s(0.65, 2.0, 5.0) == 0.0, "it may be a third off what its throttle says"
    assert dragged_m_s(0.15, 0.0, 5.0) == 0.0, "too little"


@pytest.mark.parametrize(("rolls_back", "shoots_m_s"), [(False, 2.3), (True, -2.3)])
def test_a_dragged_rover_shoots_the_way_it_rolls(rolls_back: bool, shoots_m_s: float) -> None:
    held = replace(view(ground()), speed_m_s=0.8, dragged_m_s=1.5, rolls_back=rolls_back)
    assert held.shoots_m_s == pytest.approx(shoots_m_s)
    assert replace(held, dragged_m_s=0.0).shoots_m_s == held.forward_m_s


def test_ground_that_drags_misleads_until_the_throttle_is_closed_again() -> None:
    watch = DragWatch()
    for tick in range(41):
        held_m_s(watch, 1.0, 0.8, 0.05 * tick)
        assert watch.misleads() == (tick * 0.05 > DRAGS_S - 1e-6)
    for since_s, misleads in ((0.5, True), (CLOSES_S, True), (CLOSES_S + 1.0, False)):
        held_m_s(watch, 0.2, 1.0, 2.0 + since_s)
        assert watch.misleads() == misleads
