"""The line to drive: along fields or a planner's curve, and how far the rover has come on it."""

from __future__ import annotations

import numpy as np
import pytest

from companion.control.reference_path import (
    STEP_M,
    ReferencePath,
    advanced,
    narrowest_ahead,
    path_along_curve,
    path_along_fields,
    path_is_clear,
    rejoined,
)
from companion.core.frames import NedPoint, Pose
from companion.core.grid import Cell, empty_grid
from tests.companion.mapping.test_evidence_map import HERE, Ground, Post

NORTH = tuple(Cell(10, y) for y in range(10, 19))


END = NedPoint(18.5, 10.5)


def northward(ground: Ground, start: NedPoint = HERE.point) -> ReferencePath:
    return path_along_fields(ground.map.base, NORTH, start, END)


def looked(posts: list[Post] | None = None, times: int = 10) -> Ground:
    ground = Ground()
    ground.look_round(HERE, posts or [], times)
    return ground


def test_a_path_goes_through_the_middles_of_the_fields_in_small_steps():
    grid = empty_grid(20, 20)
    cells = (Cell(2, 2), Cell(3, 3), Cell(4, 3), Cell(5, 3))
    path = path_along_fields(grid, cells, NedPoint(2.3, 2.6), NedPoint(3.7, 5.9))
    assert path.point(0) == NedPoint(2.3, 2.6) and path.end == NedPoint(3.7, 5.9)
    steps = np.hypot(*np.diff(path.points, axis=0).T)
    assert steps.max() <= STEP_M + 1e-9
    middle = grid.centre_of(Cell(3, 3))
    assert min(middle.distance_m(path.point(i)) for i in range(len(path.points))) < STEP_M


@pytest.mark.parametrize("end", [None, NedPoint(2.1, 2.2)])
def test_a_path_within_one_field(end):
    path = path_along_fields(empty_grid(5, 5), (Cell(2, 2),), NedPoint(2.9, 2.8), end)
    assert path.point(0) == NedPoint(2.9, 2.8) and path.end == (end or NedPoint(2.9, 2.8))


def test_a_path_follows_the_planners_curve_in_fields():
    curve = np.array([[1.0, 1.0], [2.0, 3.0], [4.0, 4.0]])
    grid = empty_grid(10, 10, 2.0, NedPoint(-10.0, 100.0))
    path = path_along_curve(grid, curve, grid.centre_of(Cell(1, 1)), None)
    assert path.end.distance_m(grid.centre_of(Cell(4, 4))) < 1e-9
    assert min(grid.centre_of(Cell(2, 3)).distance_m(path.point(i)) for i in range(len(path.points))) < STEP_M


def test_progress_moves_forward_and_only_within_its_window():
    path = northward(Ground())
    ahead = advanced(path, Pose(13.0, 10.7, 0.0, 0.0))
    assert ahead.point(ahead.progress).distance_m(NedPoint(13.0, 10.5)) <= STEP_M
    assert advanced(ahead, HERE).progress == ahead.progress, "never back"
    far = advanced(path, Pose(18.5, 10.5, 0.0, 0.0), window_m=2.0)
    assert far.point(far.progress).north_m <= 10.5 + 2.0 + STEP_M
    assert ahead.left_m == pytest.approx(5.5, abs=STEP_M)
    assert ahead.point_ahead(1.0).north_m == pytest.approx(14.0, abs=STEP_M)
    assert ahead.point_ahead(99.0) == END


def hooked() -> ReferencePath:
    """From (12, 10.5) three metres south, round to the east, and back north past where it began."""
    south = [(12.0 - 0.25 * i, 10.5) for i in range(13)]
    east = [(9.0, 10.5 + 0.25 * i) for i in range(1, 7)]
    north = [(9.0 + 0.25 * i, 12.0) for i in range(1, 37)]
    return ReferencePath(np.array([*south, *east, *north]))


@pytest.mark.parametrize("wall", [False, True])
def test_a_bend_that_was_cut_is_left_out_but_not_through_a_wall(wall: bool) -> None:
    """In clutter the rover turned to and fro for 50 s: it had cut a hook, and the path began where it was nearest."""
    ground, path = looked(), hooked()
    ground.map.log_odds[:] = -1.0
    if wall:
        column = int(11.5 * ground.map.subdivisions)
        ground.map.log_odds[:, column : column + 2] = 3.0
    for north_m in (13.0, 14.0, 15.0):
        here = Pose(north_m, 11.0 if wall else 11.9, 0.0, 0.0)
        path = rejoined(advanced(path, here), here.point, ground.map, 0.35)
    place = path.point(path.progress)
    assert (place == NedPoint(12.0, 10.5)) if wall else place.distance_m(NedPoint(15.0, 12.0)) < 0.2


def test_near_its_path_a_rover_leaves_nothing_out() -> None:
    ground, path = looked(), hooked()
    here = NedPoint(11.4, 11.0)
    assert rejoined(path, here, ground.map, 0.35) is path


def test_a_path_is_clear_until_something_stands_in_it():
    assert path_is_clear(northward(looked()), looked().map, 0.35)
    blocked = looked([(14.5, 10.6, 0.2)])
    assert not path_is_clear(northward(blocked), blocked.map, 0.35)
    beside = looked([(14.5, 11.6, 0.2)])
    assert path_is_clear(northward(beside), beside.map, 0.35) and not path_is_clear(northward(beside), beside.map, 1.2)


def test_the_narrowest_place_ahead_is_between_the_posts_and_only_what_is_near_counts():
    evidence = looked([(13.0, 10.0, 0.1), (13.0, 11.0, 0.1), (16.0, 10.4, 0.1)]).map
    path = path_along_fields(evidence.base, NORTH, HERE.point, END)
    room_m, place = narrowest_ahead(path, evidence, 4.0, 1.0)
    assert place.distance_m(NedPoint(13.0, 10.5)) <= STEP_M and 0.2 < room_m < 0.7
    nothing_m, _ = narrowest_ahead(path, evidence, 1.0, 1.0)
    assert nothing_m == 1.0
    room_m, place = narrowest_ahead(path, evidence, 20.0, 1.0)
    assert place.distance_m(NedPoint(16.0, 10.4)) < 0.5 and room_m < 0.3
    at_the_end = ReferencePath(path.points, len(path.points) - 1)
    assert narrowest_ahead(at_the_end, evidence, 2.0, 1.0)[1] == path.end
