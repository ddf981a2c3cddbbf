"""A position ahead takes a velocity's place only where it leads on faster, straight, and no guard is there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.control.local_view import LocalView
from companion.control.position_ahead import SLOWER_M_S, PositionAhead
from companion.control.reference_path import STEP_M, ReferencePath
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition
from tests.companion.control.test_motion_ground import PATH, ground, wall

STRICT = Settings.model_validate({"guidance": {"controller": "motion-ga"}})
GUARDED = Settings.model_validate({"guidance": {"controller": "motion-ga", "velocity_lasts_s": 0.35}})
CRUISE_M_S = 2.0


def view(evidence: EvidenceMap | None = None, heading_deg: float = 0.0, settings: Settings = STRICT) -> LocalView:
    pose = Pose(3.0, 10.0, math.radians(heading_deg), 1.0)
    return LocalView(pose, 1.5, evidence or ground(), RoverLimits(0.35, CRUISE_M_S, 8.0), settings)


def test_it_lies_ahead_on_the_path_where_that_is_faster() -> None:
    command = PositionAhead().faster_than(0.8, PATH, view())
    assert command is not None and isinstance(command.setpoint, GuidedPosition)
    assert command.setpoint.point.east_m == pytest.approx(10.0) and command.setpoint.point.north_m > 8.0


@pytest.mark.parametrize("speed_m_s", [0.0, 0.5, 1.0, 1.5, 1.9, 2.1, 2.25, 2.35])
def test_it_must_be_faster_but_for_a_little_once_positions_lead(speed_m_s: float) -> None:
    first, leads = PositionAhead(), PositionAhead()
    assert leads.faster_than(0.0, PATH, view()) is not None
    assert (first.faster_than(speed_m_s, PATH, view()) is not None) == (speed_m_s < CRUISE_M_S)
    assert (leads.faster_than(speed_m_s, PATH, view()) is not None) == (speed_m_s - SLOWER_M_S < CRUISE_M_S)


def test_with_a_guard_there_is_none() -> None:
    assert PositionAhead().faster_than(0.8, PATH, view(settings=GUARDED)) is None


def test_none_for_a_rover_that_rolls_back_or_would_have_to_turn() -> None:
    assert PositionAhead().faster_than(0.8, PATH, replace(view(), rolls_back=True)) is None
    assert PositionAhead().faster_than(0.8, PATH, view(heading_deg=15.0)) is not None
    assert PositionAhead().faster_than(0.8, PATH, view(heading_deg=70.0)) is None


def test_none_that_is_near_or_before_which_the_rover_could_not_get_fast() -> None:
    near = ReferencePath(PATH.points[: round(0.45 / STEP_M)])
    assert PositionAhead().faster_than(0.0, near, view()) is None
    walled = ground()
    wall(walled, 5.5, 6.0, 14.0)
    assert PositionAhead().faster_than(0.8, PATH, view(walled)) is None


def test_a_place_aside_only_where_the_way_on_which_the_rover_rolls_is_clear_too() -> None:
    """Told a place 45 degrees aside at 1.5 m/s it first goes on for 3.5 m."""
    walled = ground()
    wall(walled, 6.0, 6.5, 8.5)
    far = ground()
    wall(far, 6.6, 6.5, 8.5)
    for evidence, told in ((ground(), True), (walled, False), (far, False)):
        seen = replace(view(evidence), pose=Pose(3.0, 7.5, math.radians(0.0), 1.0))
        aside = ReferencePath(np.array([(3.0 + d, 7.5 + d) for d in np.arange(0.0, 4.0, STEP_M / math.sqrt(2.0))]))
        assert (PositionAhead().faster_than(0.2, aside, seen) is not None) == told
