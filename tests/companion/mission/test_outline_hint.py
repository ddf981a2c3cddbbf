"""A long rover gets a hint of the controller for which its outline counts."""

from __future__ import annotations

from companion.core.footprint import Footprint
from companion.mission.field_size import field_size
from companion.mission.mission import RoverSpec
from companion.mission.outline_hint import guard_hint, outline_hint
from companion.settings import MappingSettings

PLANNED = MappingSettings(keeps="outline")


def long_rover(length_m: float = 1.2, turning_radius_m: float = 0.0) -> RoverSpec:
    outline = Footprint.rectangle(length_m, 0.6)
    return RoverSpec(outline.radius_m, turning_radius_m=turning_radius_m, rectangle=outline)


def test_a_long_rover_is_told_how_much_narrower_gaps_may_be() -> None:
    text = outline_hint(long_rover())
    assert "a guard" in text and '"motion-ga"' in text and "through gaps of 0.8 m" in text
    side_m = float(text.partition("ground of up to ")[2].partition(" x ")[0])
    assert field_size(long_rover(), PLANNED).side_m(side_m**2, 1.0) == field_size(long_rover(), PLANNED).fine_m
    assert (
        field_size(long_rover(), PLANNED).side_m((side_m + 10.0) ** 2, 1.0) > field_size(long_rover(), PLANNED).fine_m
    )


def test_nobody_is_told_for_whom_it_changes_nothing() -> None:
    assert outline_hint(RoverSpec()) == outline_hint(long_rover(), "motion-ga") == ""
    assert outline_hint(long_rover(turning_radius_m=2.0)) == ""


def test_who_plans_motions_is_told_what_narrow_gaps_need() -> None:
    assert "rover-companion guard" in guard_hint(long_rover(), "motion-ga")
    assert guard_hint(long_rover(), "points") == guard_hint(long_rover(turning_radius_m=2.0), "motion-ga") == ""
