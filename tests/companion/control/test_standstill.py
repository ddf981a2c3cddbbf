"""When a rover must have stood, by what it rolled and was told; what the controller makes of it is tested there."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.control.local_view import LocalView
from companion.control.standstill import STANDS_M_S, Standstill
from companion.core.frames import Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import new_map
from companion.settings import Settings

GROUND = new_map(empty_grid(4, 4), 0.3, Settings().mapping)


def view(time_s: float, forward_m_s: float) -> LocalView:
    """``rolls_back`` as the program sets it: of a rover that hardly rolls it is not known."""
    at = LocalView(Pose(2.0, 2.0, 0.0, time_s), abs(forward_m_s), GROUND, RoverLimits(0.3, 2.0, 8.0), Settings())
    return replace(at, rolls_back=forward_m_s < -STANDS_M_S)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_is_needed_before_the_other_way_until_the_rover_has_stood(way: float) -> None:
    stands, found = Standstill(), []
    for time_s, onward_m_s in ((0.0, 0.3), (0.1, 0.06), (0.15, 0.04), (0.25, 0.0), (0.35, 0.0)):
        at = view(time_s, way * onward_m_s)
        stands.note(at)
        found.append(stands.is_needed_for(-0.4 * way, at, guarded=True))
        stands.told(0.0 if found[-1] else -0.4 * way, at, guarded=True)
    assert found == [True, True, True, True, False]
    rolls = view(0.4, -0.3 * way)
    stands.note(rolls)
    assert not stands.is_needed_for(-0.4 * way, rolls, guarded=True), "it goes that way already"


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_only_a_roll_the_other_way_is_gone_against_while_it_is_told_to_stand(way: float) -> None:
    stands, found = Standstill(), []
    for time_s, onward_m_s in ((0.0, 0.8), (0.1, 0.2), (0.2, -0.08), (0.25, -0.12), (0.3, -0.08), (5.0, -1.0)):
        at = view(time_s, way * onward_m_s)
        stands.note(at)
        found.append(stands.against_roll_m_s(at))
    assert found == [0.0, 0.0, 0.0, 0.2 * way, 0.0, 0.0], "at last others had led it meanwhile"


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("sent_s", "against_m_s"), [(0.3, 0.2), (-0.1, 0.0)])
def test_a_roll_against_what_it_was_just_told_is_gone_against_at_once(
    way: float, sent_s: float, against_m_s: float
) -> None:
    """It rolled back while it was told to creep on. What it was told long ago says nothing: others led it since."""
    stands, found = Standstill(), []
    for time_s, told_m_s in ((sent_s, 0.2), (0.35, 0.0), (0.4, 0.0)):
        at = view(time_s, -0.3 * way)
        stands.note(at)
        if told_m_s == 0.0:
            found.append(stands.against_roll_m_s(at))
        stands.told(told_m_s * way, at, guarded=True)
    assert found == [against_m_s * way] * 2
