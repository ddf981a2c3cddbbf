"""Map queries: metres in, metres out, wherever the map lies; along lines, beside them, on arcs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.mapping.cell_frame import CellFrame
from companion.mapping.evidence_map import EvidenceMap, new_map, penalise
from companion.mapping.map_queries import (
    ArcQueries,
    FollowLimits,
    Until,
    clearance_m,
    look_along,
    unseen_beside,
)
from companion.settings import MappingSettings
from tests.support.quick import examples

SIDE = 16
RADIUS_M = 0.35
CORNERS = [NedPoint(0.0, 0.0), NedPoint(-200.0, 300.5)]
LIMITS = FollowLimits(
    backwards=False,
    sharpest_per_m=0.4,
    steering_per_m2=0.4,
    lookahead_m=1.5,
    room_m=0.4,
    flank_m=0.4,
    near_m=0.55,
    tail_m=0.0,
    astray_m=1.5,
)
NORTHWARD = np.column_stack((np.arange(4.0, 14.0, 0.25), np.full(40, 8.0)))


def seen_map(corner: NedPoint = CORNERS[0], resolution_m: float = 1.0) -> EvidenceMap:
    side = round(SIDE / resolution_m)
    evidence = new_map(empty_grid(side, side, resolution_m, corner), RADIUS_M, MappingSettings())
    evidence.log_odds.fill(-1.0)
    return evidence


def put(evidence: EvidenceMap, north_m: float, east_m: float, value: float = 2.0) -> None:
    """One cell, from the map's corner."""
    evidence.log_odds[int(north_m / evidence.evidence_m), int(east_m / evidence.evidence_m)] = value


def at(corner: NedPoint, north_m: float, east_m: float) -> NedPoint:
    return NedPoint(corner.north_m + north_m, corner.east_m + east_m)


# --- metres and cells ------------------------------------------------------------------------------------------------


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.sampled_from([0.05, 0.125, 0.3]))
def test_a_place_comes_back_from_cells(north_m: float, east_m: float, cell_m: float) -> None:
    frame, point = CellFrame(NedPoint(-7.0, 11.0), cell_m), NedPoint(north_m, east_m)
    x, y = frame.xy(point)
    assert (x, y) == pytest.approx(((east_m - 11.0) / cell_m, (north_m + 7.0) / cell_m), abs=1e-6)
    assert frame.point(x, y).distance_m(point) < 1e-9
    both = np.array([[north_m, east_m], [0.0, 0.0]])
    assert frame.xys(both)[0] == pytest.approx((x, y)) and frame.points(frame.xys(both)) == pytest.approx(both)


@given(st.floats(0.0, 100.0), st.sampled_from([0.05, 0.125, 0.3]))
def test_lengths_and_curvatures_scale_inversely(length_m: float, cell_m: float) -> None:
    frame = CellFrame(NedPoint(0.0, 0.0), cell_m)
    assert frame.cells(length_m) == pytest.approx(length_m / cell_m)
    assert frame.metres(frame.cells(length_m)) == pytest.approx(length_m)
    assert frame.per_cell(0.4) * frame.cells(length_m) == pytest.approx(0.4 * length_m), (
        "the turn of an arc is the same"
    )
    assert frame.per_m(frame.per_cell(0.4)) == pytest.approx(0.4)


# --- along and beside a line -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("corner", CORNERS)
@pytest.mark.parametrize("resolution_m", [0.5, 1.0])
def test_a_line_is_the_same_wherever_the_map_lies(corner: NedPoint, resolution_m: float) -> None:
    evidence = seen_map(corner, resolution_m)
    put(evidence, 10.0, 8.2)
    put(evidence, 12.0, 8.0, 0.0)
    here = at(corner, 4.0, 8.06)
    line = look_along(evidence, here, at(corner, 14.0, 8.06), RADIUS_M)
    assert line.clear_m == pytest.approx(6.0 - RADIUS_M, abs=0.15)
    assert look_along(evidence, here, at(corner, 14.0, 8.06), 0.05).seen_m == pytest.approx(8.0, abs=0.13)
    assert clearance_m(evidence, here, 8.0) == pytest.approx(6.0, abs=0.1)
    assert clearance_m(evidence, here, 2.0) == 2.0


@pytest.mark.parametrize("corner", CORNERS)
def test_the_nearest_unseen_place_beside_a_line_is_found_on_either_side(corner: NedPoint) -> None:
    for side in (-1.0, 1.0):
        evidence = seen_map(corner)
        put(evidence, 9.0, 8.06 + side * 0.5, 0.0)
        here, there = at(corner, 4.0, 8.06), at(corner, 12.0, 8.06)
        unseen = unseen_beside(evidence, here, there, 0.5, 0.6)
        assert unseen is not None and unseen.along_m == pytest.approx(5.0, abs=0.13)
        assert unseen.place.distance_m(at(corner, 9.0, 8.06 + side * 0.5)) < 0.2
        assert unseen_beside(evidence, here, there, 0.2, 0.6) is None, "not so far aside"
        assert unseen_beside(evidence, here, there, 0.5, 5.5) is None, "too near"


# --- arcs ------------------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=examples(60))
@given(st.floats(-0.6, 0.6), st.floats(-3.1, 3.1), st.sampled_from(CORNERS))
def test_an_arc_ends_at_what_stands_on_it(curvature_per_m: float, course_rad: float, corner: NedPoint) -> None:
    evidence = seen_map(corner)
    here = at(corner, 8.06, 8.06)
    half_rad = 0.5 * curvature_per_m * 3.0
    place = here.moved(course_rad + half_rad, 3.0 * float(np.sinc(half_rad / math.pi)))
    put(evidence, place.north_m - corner.north_m, place.east_m - corner.east_m)
    arcs = ArcQueries(evidence, Pose(here.north_m, here.east_m, 0.0, 0.0))
    clear_m = arcs.arc_clear_m(course_rad, curvature_per_m, RADIUS_M, 5.0, Until.BLOCKED)
    assert clear_m <= 3.0
    if abs(curvature_per_m) < 0.3:  # sharper ones come near to it before
        assert clear_m >= 3.0 - RADIUS_M - 0.35
    assert not arcs.arc_is_clear(course_rad, curvature_per_m, RADIUS_M, 5.0, Until.BLOCKED)
    assert arcs.arc_is_clear(course_rad, curvature_per_m, RADIUS_M, 1.5, Until.UNSEEN)


def test_an_arc_ends_at_unseen_ground_only_if_asked_to() -> None:
    evidence = seen_map()
    evidence.log_odds[80:] = 0.0
    arcs = ArcQueries(evidence, Pose(8.0, 8.0, 0.0, 0.0))
    assert arcs.arc_clear_m(0.0, 0.0, RADIUS_M, 5.0, Until.UNSEEN) == pytest.approx(2.0, abs=0.13)
    assert arcs.arc_clear_m(0.0, 0.0, RADIUS_M, 5.0, Until.BLOCKED) == pytest.approx(5.0)
    assert arcs.arc_clear_m(0.0, 0.0, RADIUS_M, 12.0, Until.BLOCKED) == pytest.approx(8.0, abs=0.13), "the edge"


@pytest.mark.parametrize("corner", CORNERS)
def test_an_arc_ends_beside_unseen_ground_that_is_near_an_obstacle(corner: NedPoint) -> None:
    """0.3 m east of the way is unseen ground, and an obstacle is 1 m away from the nearest of it."""
    evidence = seen_map(corner)
    here = at(corner, 4.0, 8.06)
    arcs = ArcQueries(evidence, Pose(here.north_m, here.east_m, 0.0, 0.0))
    put(evidence, 8.0, 8.3, 0.0)
    put(evidence, 8.0, 9.3)

    def clear_m(gap_m: float) -> float:
        return arcs.arc_clear_m(0.0, 0.0, RADIUS_M, 7.0, Until.UNSEEN, gap_m)

    assert clear_m(0.0) == clear_m(0.8) == pytest.approx(7.0)
    assert clear_m(1.1) == pytest.approx(4.0 - RADIUS_M, abs=0.25)


@pytest.mark.parametrize("radius_m", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("towards_deg", [-50, -20, 0, 35, 50])
def test_backwards_the_rim_stays_on_seen_ground_wherever_that_ends(radius_m: float, towards_deg: float) -> None:
    """Unseen ground of three cells; where there is no more than a single one it is not looked at."""
    here, aside_rad = NedPoint(4.06, 8.06), math.radians(towards_deg)
    rim = NedPoint(here.north_m + 3.0, here.east_m).moved(aside_rad, radius_m)
    arcs, evidence = {}, {}
    for side in (1, 3):
        evidence[side] = seen_map()
        y, x = (math.floor(v / evidence[side].evidence_m) for v in (rim.north_m, rim.east_m))
        half = side // 2
        evidence[side].log_odds[y - half : y + half + 1, x - half : x + half + 1] = 0.0
        arcs[side] = ArcQueries(evidence[side], Pose(here.north_m, here.east_m, math.pi, 0.0))
    clear_m = arcs[3].arc_clear_m(0.0, 0.0, 0.1, 6.0, Until.BLOCKED, tail_m=radius_m)
    assert 2.4 < clear_m < 3.4
    assert arcs[1].arc_clear_m(0.0, 0.0, 0.1, 6.0, Until.BLOCKED, tail_m=radius_m) == pytest.approx(6.0)
    assert arcs[3].arc_clear_m(0.0, 0.0, 0.1, 6.0, Until.BLOCKED) == pytest.approx(6.0), "forwards it may"


def test_closed_fields_end_an_arc_but_not_the_one_that_the_rover_stands_in() -> None:
    evidence = seen_map()
    here = Pose(8.5, 8.5, 0.0, 0.0)
    for north_m in (8.5, 11.5):
        penalise(evidence, evidence.base.cell_at(NedPoint(north_m, 8.5)), 1.0)
    clear_m = ArcQueries(evidence, here).arc_clear_m(0.0, 0.0, RADIUS_M, 6.0, Until.BLOCKED)
    assert clear_m == pytest.approx(2.5, abs=0.13)


@pytest.mark.parametrize(("beside_m", "kept_m"), [(3.0, 0.9), (0.7, 0.66), (0.3, 0.3)])
def test_the_room_kept_is_what_there_is_but_not_less_than_the_least(beside_m: float, kept_m: float) -> None:
    evidence = seen_map()
    put(evidence, 8.0, 8.0 + beside_m + 0.0625)
    room_m = ArcQueries(evidence, Pose(8.06, 8.0, 0.0, 0.0)).kept_room_m(0.9, 0.3)
    assert room_m == pytest.approx(kept_m, abs=0.1) and 0.3 <= room_m <= 0.9


# --- following a line ------------------------------------------------------------------------------------------------


def test_a_line_ahead_is_followed_straight_to_its_end() -> None:
    arcs = ArcQueries(seen_map(), Pose(4.0, 8.0, 0.0, 0.0))
    followed = arcs.follow(NORTHWARD, 0.0, LIMITS, 8.0)
    assert followed.clear_m == followed.seen_m == math.inf and followed.curvature_per_m == pytest.approx(0.0)


def test_following_ends_at_an_obstacle_and_notes_unseen_ground_before_it() -> None:
    evidence = seen_map()
    put(evidence, 10.0, 8.0)
    evidence.log_odds[72:76] = 0.0
    followed = ArcQueries(evidence, Pose(4.0, 8.0, 0.0, 0.0)).follow(NORTHWARD, 0.0, LIMITS, 8.0)
    assert followed.clear_m == pytest.approx(6.0 - LIMITS.room_m, abs=0.2)
    assert followed.seen_m == pytest.approx(5.0, abs=0.13)


def test_backwards_following_ends_where_the_tail_would_be_on_unseen_ground() -> None:
    evidence = seen_map()
    evidence.log_odds[80:84, 65:69] = 0.0
    tail_first = ArcQueries(evidence, Pose(4.0, 8.0, math.pi, 0.0))
    limits = replace(LIMITS, near_m=20.0)
    backwards = tail_first.follow(NORTHWARD, 0.0, replace(limits, backwards=True, tail_m=0.4), 8.0)
    assert backwards.seen_m == pytest.approx(5.7, abs=0.2)
    forwards = ArcQueries(evidence, Pose(4.0, 8.0, 0.0, 0.0))
    assert forwards.follow(NORTHWARD, 0.0, limits, 8.0).seen_m == math.inf


def test_a_line_beside_is_steered_for_and_no_sharper_than_the_rover_can() -> None:
    right = ArcQueries(seen_map(), Pose(4.0, 7.5, 0.0, 0.0)).follow(NORTHWARD, 0.0, LIMITS, 8.0)
    left = ArcQueries(seen_map(), Pose(4.0, 8.5, 0.0, 0.0)).follow(NORTHWARD, 0.0, LIMITS, 8.0)
    assert 0.1 < right.curvature_per_m <= LIMITS.sharpest_per_m
    assert left.curvature_per_m == pytest.approx(-right.curvature_per_m)


@pytest.mark.parametrize("pose", [Pose(4.0, 8.0, math.pi, 0.0), Pose(4.0, 11.0, 0.0, 0.0)], ids=["behind", "astray"])
def test_a_line_behind_or_far_aside_cannot_be_followed(pose: Pose) -> None:
    assert ArcQueries(seen_map(), pose).follow(NORTHWARD, 0.0, LIMITS, 8.0).clear_m == 0.0


def test_progress_along_a_line_never_goes_back_and_tells_what_is_left() -> None:
    arcs = ArcQueries(seen_map(), Pose(6.0, 8.0, 0.0, 0.0))
    index, left_m = arcs.progress_along(NORTHWARD, 0, 0.0, 0.25)
    assert index == 8 and left_m == pytest.approx(NORTHWARD[-1, 0] - 6.0, abs=0.26)
    assert arcs.progress_along(NORTHWARD, 20, 0.0, 0.25)[0] == 20
    end = Pose(13.7, 8.0, 0.0, 0.0)
    assert ArcQueries(seen_map(), end).progress_along(NORTHWARD, 30, 0.0, 0.25) == (39, pytest.approx(0.05))
    beyond = Pose(14.0, 8.0, 0.0, 0.0)
    assert ArcQueries(seen_map(), beyond).progress_along(NORTHWARD, 30, 0.0, 0.25) == (39, 0.0)
