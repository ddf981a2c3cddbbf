"""Borders: what of the ground they close, who is beyond them, and which ways would cross them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import OBSTACLE, Cell
from companion.mission.autopilot_fence import (
    NO_FENCE,
    PARAMETERS,
    AutopilotFence,
    autopilot_fence,
)
from companion.mission.bounds import Bound, Bounds, autopilot_bounds
from companion.mission.items import Item, ItemError
from companion.mission.mission import Area, GridSpec, HomePoint, Mission, MissionError, RoverSpec, Target
from companion.mission.resolve import ResolvedMission, resolve
from tests.support.quick import examples

HOME = GeoPoint(-35.3632613, 149.1652299)
FRAME = LocalFrame(HOME)
HERE = NedPoint(0.0, 0.0)
ON = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 6.0, "FENCE_MARGIN": 2.0, "FENCE_RADIUS": 300.0, "FENCE_OPTIONS": 0.0}
SQUARE = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))


def item(index: int, command: int, north_m: float, east_m: float, first: float = 0.0) -> Item:
    place = FRAME.to_geo(NedPoint(north_m, east_m))
    return Item(index, command, 0, (first, 0.0, 0.0, 0.0), place.lat_deg, place.lon_deg)


def polygon(command: int, corners: tuple[tuple[float, float], ...]) -> list[Item]:
    return [item(i, command, *corner, first=float(len(corners))) for i, corner in enumerate(corners)]


def geo_area(corners: tuple[tuple[float, float], ...]) -> Area:
    return Area(tuple(FRAME.to_geo(NedPoint(*corner)) for corner in corners))


def laid(fence: AutopilotFence, *targets: HomePoint, **fields: object) -> ResolvedMission:
    places = targets or (HomePoint(0.0, 5.0),)
    targets = tuple(Target(f"t{i}", place) for i, place in enumerate(places))
    mission = Mission("m", targets, **fields)  # type: ignore[arg-type]
    return resolve(mission, FRAME, HERE, fence)


def ground_bounds(fence: AutopilotFence, body_m: float = 0.35) -> Bounds:
    return Bounds(autopilot_bounds(fence, FRAME, body_m))


# --- what is in force ------------------------------------------------------------------------------------------------


def test_stored_areas_and_the_circle_make_the_fence() -> None:
    items = [*polygon(5001, SQUARE), item(4, 5004, 5.0, 6.0, 3.0)]
    fence = autopilot_fence(items, ON, HOME, enabled=False)
    assert [len(area.places) for area in fence.keep_in] == [4]
    assert [area.radius_m for area in fence.keep_out] == [3.0]
    assert (fence.circle_m, fence.home, fence.margin_m, fence.any_of) == (300.0, HOME, 2.0, False)
    assert autopilot_fence(items, {**ON, "FENCE_OPTIONS": 3.0}, HOME, enabled=False).any_of


@pytest.mark.parametrize(
    ("changes", "areas", "circle_m"),
    [({"FENCE_TYPE": 4.0}, 1, None), ({"FENCE_TYPE": 2.0}, 0, 300.0), ({"FENCE_RADIUS": 0.0}, 1, None)],
)
def test_the_kinds_that_are_chosen_count(changes: dict[str, float], areas: int, circle_m: float | None) -> None:
    fence = autopilot_fence(polygon(5001, SQUARE), {**ON, **changes}, HOME, enabled=False)
    assert (len(fence.keep_in), fence.circle_m) == (areas, circle_m)


def test_a_fence_that_is_switched_off_is_none_unless_it_was_switched_on_otherwise() -> None:
    off, items = {**ON, "FENCE_ENABLE": 0.0}, polygon(5002, SQUARE)
    assert autopilot_fence(items, off, HOME, enabled=False) == NO_FENCE
    assert autopilot_fence(items, off, HOME, enabled=True).keep_out
    assert autopilot_fence([], {**ON, "FENCE_TYPE": 4.0}, HOME, enabled=False) == NO_FENCE


def test_a_firmware_without_these_parameters_enforces_what_is_stored() -> None:
    fence = autopilot_fence(polygon(5001, SQUARE), {}, HOME, enabled=False)
    assert (len(fence.keep_in), fence.circle_m, fence.margin_m) == (1, None, 2.0)
    assert len(PARAMETERS) == len(ON)


def test_items_that_make_no_fence_are_an_error() -> None:
    with pytest.raises(ItemError, match="3 of its 4 corners"):
        autopilot_fence(polygon(5001, SQUARE)[:3], ON, HOME, enabled=False)


@pytest.mark.parametrize("margin_m", [math.nan, -1.0, math.inf])
def test_a_margin_that_is_none_counts_as_zero(margin_m: float) -> None:
    assert autopilot_fence(polygon(5001, SQUARE), {**ON, "FENCE_MARGIN": margin_m}, HOME, enabled=False).margin_m == 0.0


# --- what the planner sees -------------------------------------------------------------------------------------------


def test_the_planner_keeps_the_margin_everywhere_and_no_more_than_a_field_farther() -> None:
    fence = AutopilotFence((geo_area(SQUARE),), margin_m=2.0)
    result = laid(fence, grid=GridSpec(margin_m=30.0))
    grid = result.grid
    open_fields = np.argwhere(grid.weights < OBSTACLE)
    for y, x in open_fields:
        centre = grid.centre_of(Cell(int(x), int(y)))
        assert max(abs(centre.north_m), abs(centre.east_m)) <= 18.0 - 0.5 + 1e-2
    assert grid.weights[grid.cell_at(NedPoint(16.4, 0.0)).y, grid.cell_at(NedPoint(16.4, 0.0)).x] < OBSTACLE


def test_the_rovers_radius_counts_where_the_margin_is_smaller() -> None:
    fence = AutopilotFence((), (geo_area(((4.5, -20.0), (6.5, -20.0), (6.5, 20.0), (4.5, 20.0))),), margin_m=0.0)
    wide = laid(fence, grid=GridSpec(margin_m=30.0), rover=RoverSpec(radius_m=1.2)).grid
    column = wide.cell_at(HERE).x
    closed = [wide.centre_of(Cell(column, y)).north_m for y in np.flatnonzero(wide.weights[:, column] >= OBSTACLE)]
    assert closed == pytest.approx([3.0, 4.0, 5.0, 6.0, 7.0, 8.0]), "from 3.3 m to 7.7 m"


def test_mission_fences_keep_the_rovers_radius_too() -> None:
    corners = tuple(HomePoint(*corner) for corner in ((0.5, 9.5), (2.5, 9.5), (2.5, 11.5), (0.5, 11.5)))
    grid = laid(NO_FENCE, HomePoint(0.0, -5.0), keep_out=(Area(corners),), grid=GridSpec(margin_m=5.0)).grid
    assert int((grid.weights >= OBSTACLE).sum()) == 16, "two by two fields, and those round them"


def test_a_target_behind_the_autopilots_fence_is_named_and_one_behind_the_missions_is_refused() -> None:
    fence = AutopilotFence((geo_area(SQUARE),), margin_m=2.0)
    refused = laid(fence, HomePoint(0.0, 5.0), HomePoint(0.0, 19.0)).refused
    assert list(refused) == [1]
    assert "target 2 't1': lies outside (or within a field of the edge of) the autopilot's fence" in refused[1]
    with pytest.raises(MissionError, match=r"target 2 't1': lies outside .* keep_in 1"):
        area = Area(tuple(HomePoint(*corner) for corner in SQUARE))
        laid(NO_FENCE, HomePoint(0.0, 5.0), HomePoint(0.0, 25.0), keep_in=(area,))


def test_inside_any_of_the_areas_is_enough_when_the_autopilot_says_so() -> None:
    east = tuple((north, east + 30.0) for north, east in SQUARE)
    areas = (geo_area(SQUARE), geo_area(east))
    for any_of, inside in ((True, True), (False, False)):
        bounds = ground_bounds(AutopilotFence(areas, any_of=any_of))
        assert (bounds.outside(NedPoint(0.0, 45.0)) == "") is inside
        assert bounds.outside(NedPoint(0.0, 15.0)) == ""
        assert (bounds.fault([HERE, NedPoint(0.0, 45.0)]) == "") is inside


def test_the_circle_is_round_home() -> None:
    bounds = ground_bounds(AutopilotFence(circle_m=50.0, home=FRAME.to_geo(NedPoint(10.0, 0.0))))
    assert bounds.outside(NedPoint(59.5, 0.0)) == ""
    assert "circle of 50 m round home" in bounds.outside(NedPoint(-40.5, 0.0))


def test_a_polygon_whose_sides_cross_encloses_what_it_encloses() -> None:
    bow = ((-10.0, -10.0), (10.0, 10.0), (10.0, -10.0), (-10.0, 10.0))
    bounds = ground_bounds(AutopilotFence((geo_area(bow),)))
    assert bounds.outside(NedPoint(5.0, 0.0)) == "" and bounds.outside(NedPoint(0.0, 5.0)) != ""


# --- what may be sent ------------------------------------------------------------------------------------------------


@pytest.fixture
def walled() -> Bounds:
    """Inside a square of 40 m with a round hole of 3 m radius at 0, 10; the rover is 0.35 m."""
    hole = Area((FRAME.to_geo(NedPoint(0.0, 10.0)),), radius_m=3.0)
    return ground_bounds(AutopilotFence((geo_area(SQUARE),), (hole,), margin_m=2.0))


@pytest.mark.parametrize(
    ("start", "end", "name"),
    [
        ((0.0, 0.0), (15.0, 0.0), ""),
        ((0.0, 0.0), (25.0, 0.0), "inclusion area 1"),
        ((0.0, 0.0), (19.8, 0.0), "inclusion area 1"),  # the rover's flank would be over it
        ((0.0, 0.0), (19.6, 0.0), ""),
        ((0.0, 0.0), (0.0, 18.0), "exclusion area 1"),  # straight through it
        ((0.0, 0.0), (0.0, 6.6), ""),
        ((0.0, 0.0), (0.0, 6.75), "exclusion area 1"),
        ((19.8, 0.0), (15.0, 0.0), ""),  # who is too near may leave
        ((19.8, 0.0), (19.8, 8.0), ""),  # ... or go along
        ((19.8, 0.0), (19.95, 8.0), "inclusion area 1"),
        ((21.0, 0.0), (15.0, 0.0), "inclusion area 1"),  # who is outside stays where he is
        ((0.0, 9.0), (0.0, 5.0), "exclusion area 1"),
    ],
)
def test_a_way_that_crosses_a_border_is_found(
    walled: Bounds, start: tuple[float, float], end: tuple[float, float], name: str
) -> None:
    fault = walled.fault([NedPoint(*start), NedPoint(*end)])
    assert name in fault and bool(name) == bool(fault)


def test_who_stands_too_near_comes_no_nearer_however_often_it_is_asked() -> None:
    bounds, north_m = Bounds([Bound("b", shapely.box(-20.0, -20.0, 20.0, 20.0), True, 0.35, 0.35)]), 19.6
    for _ in range(100):
        nearer = NedPoint(north_m + 0.04, 0.0)
        if not bounds.fault([NedPoint(north_m, 0.0), nearer]):
            north_m = nearer.north_m
    assert 19.6 < north_m <= 19.7 + 1e-9
    for start_m in (19.6, 19.75, 19.95):
        assert bounds.fault([NedPoint(start_m, 0.0), NedPoint(start_m, 5.0)]) == "", "beside the border"
        assert bounds.fault([NedPoint(start_m, 0.0), NedPoint(start_m - 1.0, 5.0)]) == "", "away from it"


def test_a_rover_begins_with_the_whole_margin_or_not_at_all(walled: Bounds) -> None:
    assert walled.too_near(NedPoint(17.9, 0.0)) == ""
    assert "2 m or more inside the autopilot's fence (inclusion area 1)" in walled.too_near(NedPoint(18.2, 0.0))
    assert "2 m or more away from the autopilot's fence (exclusion area 1)" in walled.too_near(NedPoint(0.0, 5.2))


def test_no_borders_no_faults() -> None:
    bounds = ground_bounds(NO_FENCE)
    assert len(bounds) == 0
    assert bounds.fault([HERE, NedPoint(1e6, 1e6)]) == bounds.outside(HERE) == bounds.too_near(HERE) == ""


Coordinate = st.floats(-30.0, 30.0).map(lambda metres: round(metres, 6))


@settings(max_examples=examples(200), deadline=None)
@given(
    corners=st.lists(st.tuples(Coordinate, Coordinate), min_size=3, max_size=7, unique=True),
    start=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    end=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    keeps_in=st.booleans(),
)
def test_no_way_that_passes_leaves_the_open_ground(
    corners: list[tuple[float, float]], start: tuple[float, float], end: tuple[float, float], keeps_in: bool
) -> None:
    shape = shapely.Polygon(corners)
    if not shape.is_valid or shape.area < 1.0:
        return
    bounds = Bounds([Bound("b", shape, keeps_in, 2.0, 0.35)])
    way = [NedPoint(start[1], start[0]), NedPoint(end[1], end[0])]
    if bounds.fault(way):
        return
    for share in np.linspace(0.0, 1.0, 41):
        at = shapely.Point(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        assert shapely.contains(shape, at) if keeps_in else not shapely.contains(shape, at)
