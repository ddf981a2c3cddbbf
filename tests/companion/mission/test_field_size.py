"""How large fields are where the mission does not say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.footprint import Footprint
from companion.mission.field_size import FieldSize, field_size, finer_evidence, map_radius_m, sure_gap_m
from companion.mission.mission import RoverSpec
from companion.settings import MappingSettings

CIRCLE, OUTLINE = MappingSettings(), MappingSettings(keeps="outline", evidence_m=0.05)
LONG = RoverSpec(0.6, rectangle=Footprint.rectangle(0.9, 0.7))


@pytest.mark.parametrize(
    ("rover", "settings", "fine_m"),
    [
        (RoverSpec(0.35), CIRCLE, 0.15),
        (RoverSpec(0.6), CIRCLE, 0.25),
        (RoverSpec(0.05), CIRCLE, 0.05),
        (LONG, OUTLINE, 0.25),
    ],
)
def test_the_rover_says_how_small(rover: RoverSpec, settings: MappingSettings, fine_m: float) -> None:
    assert field_size(rover, settings).fine_m == pytest.approx(fine_m)


def test_a_rover_that_needs_wider_gaps_has_larger_fields() -> None:
    assert field_size(RoverSpec(0.35, turning_radius_m=2.0), CIRCLE).fine_m == 0.25
    assert field_size(RoverSpec(0.35), CIRCLE, narrow_sight=True).fine_m == 1.0
    assert field_size(LONG, OUTLINE, narrow_sight=True).fine_m == 1.0


def test_no_obstacle_fits_between_two_places_of_a_field_where_motions_are_planned() -> None:
    assert math.sqrt(2.0) * field_size(LONG, OUTLINE).fine_m <= map_radius_m(LONG, OUTLINE)


@given(st.floats(1.0, 1e7), st.floats(0.05, 2.0), st.integers(1000, 1_000_000))
def test_there_are_no_more_fields_than_are_wanted_unless_the_largest_are_too_small(
    area_m2: float, fine_m: float, most: int
) -> None:
    side_m = FieldSize(fine_m, most).side_m(area_m2, 1.0)
    assert side_m <= 1.0
    assert side_m == 1.0 or (side_m >= fine_m and area_m2 / side_m**2 <= most * 1.001)


@given(st.floats(0.0, math.pi), st.floats(0.0, 1.0), st.sampled_from([0.15, 0.3, 1.0]))
def test_in_a_sure_gap_the_middles_of_fields_form_a_way_however_it_is_turned(
    angle_rad: float, shift: float, side_m: float
) -> None:
    rover, settings = RoverSpec(0.35), finer_evidence(CIRCLE, side_m)
    gap_m = sure_gap_m(rover, settings, side_m) + 0.05
    room_m = gap_m - 2.0 * (rover.radius_m + settings.evidence_m)
    along = (np.arange(41) - 20.0) * side_m
    x, y = np.meshgrid(along, along)
    open_ = np.abs(x * math.cos(angle_rad) + y * math.sin(angle_rad) + (shift - 0.5) * side_m) <= 0.5 * room_m
    seen, todo = set(), [tuple(cell) for cell in np.argwhere(open_) if 20 in cell][:1]
    while todo:
        row, column = todo.pop()
        if (row, column) in seen or not (0 <= row < 41 and 0 <= column < 41 and open_[row, column]):
            continue
        seen.add((row, column))
        todo += [(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    rows, columns = zip(*seen, strict=True)
    assert max(max(rows) - min(rows), max(columns) - min(columns)) == 40


def test_a_rover_of_the_default_size_drives_through_a_metre() -> None:
    assert sure_gap_m(RoverSpec(), finer_evidence(CIRCLE, 0.15), 0.15) == pytest.approx(1.0)
    assert sure_gap_m(RoverSpec(), finer_evidence(CIRCLE, 0.25), 0.25) == pytest.approx(1.2)
    assert sure_gap_m(RoverSpec(), CIRCLE, 1.0) == pytest.approx(2.4)


@pytest.mark.parametrize(("side_m", "gap_m"), [(0.25, 0.9), (0.4, 1.4)])
def test_planned_motions_go_through_what_the_outline_needs_where_fields_are_fine_enough(
    side_m: float, gap_m: float
) -> None:
    """Gates of 0.9 m are passed by a rover of 0.7 m with the fields that follow from it."""
    assert sure_gap_m(RoverSpec(0.35), finer_evidence(OUTLINE, side_m), side_m) == pytest.approx(gap_m)
