"""A long rover gets a hint of the controller for which its outline counts."""

from __future__ import annotations

from companion.core.footprint import Footprint
from companion.mission.mission import RoverSpec
from companion.mission.outline_hint import outline_hint


def long_rover(length_m: float = 1.2, turning_radius_m: float = 0.0) -> RoverSpec:
    outline = Footprint.rectangle(length_m, 0.6)
    return RoverSpec(outline.radius_m, turning_radius_m=turning_radius_m, rectangle=outline)


def test_a_long_rover_is_told_how_much_narrower_gaps_may_be() -> None:
    text = outline_hint(long_rover())
    assert "gaps of 1.9 m or more" in text and '"motion-ga"' in text and "through 0.8 m" in text


def test_nobody_is_told_for_whom_it_changes_nothing() -> None:
    assert outline_hint(RoverSpec()) == outline_hint(long_rover(), "motion-ga") == ""
    assert outline_hint(long_rover(turning_radius_m=2.0)) == ""
