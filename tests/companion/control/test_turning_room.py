"""Turning on the spot: against shapes."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given
from hypothesis import settings as runs
from hypothesis import strategies as st
from shapely import affinity

from companion.control.local_view import LocalView
from companion.control.turning_room import may_turn_to
from companion.core.footprint import Footprint
from companion.core.frames import Pose, wrap_pi_rad
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.settings import Settings
from tests.support.quick import examples

SETTINGS = Settings.model_validate({"mapping": {"evidence_m": 0.1}})
LONG = Footprint.rectangle(2.0, 0.5, 0.2)


def with_post(north_m: float, east_m: float) -> EvidenceMap:
    """One cell, so far from the middle."""
    evidence = new_map(empty_grid(10, 10), 0.35, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    evidence.log_odds[math.floor((5.0 + north_m) / 0.1), math.floor((5.0 + east_m) / 0.1)] = 3.0
    return evidence


def view(evidence: EvidenceMap, heading_rad: float, body: Footprint = LONG) -> LocalView:
    return LocalView(Pose(5.0, 5.0, heading_rad, 0.0), 0.0, evidence, RoverLimits(0.35, 2.0, 8.0), SETTINGS, body=body)


@given(
    north_m=st.floats(-1.5, 1.5), east_m=st.floats(-1.5, 1.5),
    heading_rad=st.floats(-3.0, 3.0), bearing_rad=st.floats(-3.0, 3.0),
)  # fmt: skip
@runs(max_examples=examples(200), deadline=None)
def test_it_may_turn_where_the_outline_sweeps_over_nothing(
    north_m: float, east_m: float, heading_rad: float, bearing_rad: float
) -> None:
    evidence = with_post(north_m, east_m)
    middle = (np.argwhere(evidence.log_odds > 0.0)[0] + 0.5) * 0.1 - 5.0
    box = shapely.box(-LONG.rear_m, -LONG.half_width_m, LONG.front_m, LONG.half_width_m)
    turns_rad = np.linspace(0.0, wrap_pi_rad(bearing_rad - heading_rad), 400)
    outlines = [affinity.rotate(box, heading_rad + turn, origin=(0.0, 0.0), use_radians=True) for turn in turns_rad]
    apart_m = [outline.distance(shapely.Point(*middle)) for outline in outlines]
    deep_m = [outline.exterior.distance(shapely.Point(*middle)) for outline in outlines]
    may = may_turn_to(bearing_rad, view(evidence, heading_rad))
    if min(apart_m) > 0.03:
        assert may
    if apart_m[0] > 0.03 and any(apart == 0.0 and deep > 0.03 for apart, deep in zip(apart_m, deep_m, strict=True)):
        assert not may


def test_a_circle_turns_anywhere_and_what_lies_in_the_outline_may_be_left() -> None:
    evidence = with_post(1.05, 0.0)
    assert may_turn_to(1.5, view(evidence, 0.0)), "it turns away from it"
    assert not may_turn_to(0.0, view(evidence, 1.5))
    assert may_turn_to(0.0, view(evidence, 1.5, Footprint.circle(1.0)))
