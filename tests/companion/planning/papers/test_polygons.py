"""Obstacles as polygons: their fields and corners, and that lines between corners are correct paths."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from companion.core.grid import BASE_WEIGHT, inflated
from companion.planning.papers.polygons import polygons_of, rectangles, without_notches
from companion.planning.raster import first_fault, plain, polyline
from tests.support.planning_maps import drawn
from tests.support.quick import examples


@st.composite
def maps(draw):
    height, width = draw(st.integers(1, 25)), draw(st.integers(1, 25))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    weights = np.full((height, width), BASE_WEIGHT)
    weights[rng.random((height, width)) < draw(st.sampled_from([0.02, 0.1, 0.3, 0.6]))] = 1.0
    return weights


@given(weights=maps())
@settings(max_examples=examples(100), deadline=None)
def test_rectangles_cover_the_obstacles_once(weights):
    times = np.zeros(weights.shape, int)
    for x0, y0, x1, y1 in rectangles(weights):
        times[y0 : y1 + 1, x0 : x1 + 1] += 1
    assert np.array_equal(times, weights >= 1.0)


@given(weights=maps())
@settings(max_examples=examples(100), deadline=None)
def test_an_obstacle_is_what_touches_even_at_corners(weights):
    polygons = polygons_of(weights, 0.5)
    regions, count = label(weights >= 1.0, np.ones((3, 3)))
    assert np.array_equal(regions > 0, polygons.owner > 0)
    assert len({(a, b) for a, b in zip(regions.ravel(), polygons.owner.ravel(), strict=True) if a}) == count
    assert len(polygons.obstacle_rings) == count + 1 and polygons.obstacle_rings[-1] == len(polygons.rings)


@given(weights=maps())
@settings(max_examples=examples(100), deadline=None)
def test_corners_are_on_free_ground_beside_their_obstacle(weights):
    polygons = polygons_of(weights, 0.5)
    padded = np.pad(polygons.owner, 2)
    for obstacle in range(1, len(polygons.obstacle_rings)):
        for ring in range(*polygons.obstacle_rings[obstacle - 1 : obstacle + 1]):
            for x, y in polygons.corners[slice(*polygons.rings[ring])]:
                assert padded[y + 2, x + 2] == 0
                assert obstacle in padded[y + 1 : y + 4, x + 1 : x + 4]


def test_a_block_has_four_corners_one_field_outside():
    weights = np.full((12, 12), BASE_WEIGHT)
    weights[4:7, 3:8] = 1.0
    assert set(map(tuple, polygons_of(weights, 0.5).corners.tolist())) == {(2, 3), (8, 3), (8, 7), (2, 7)}
    assert set(map(tuple, polygons_of(weights, 1.0).corners.tolist())) == {(1, 2), (9, 2), (9, 8), (1, 8)}


def test_the_safe_distance_is_that_of_the_inflated_map():
    weights = np.full((30, 30), BASE_WEIGHT)
    weights[10:14, 10:20] = 1.0
    assert np.array_equal(polygons_of(weights, 2.3).owner > 0, inflated(weights, 2.3) >= 1.0)


def test_the_steps_of_a_slanting_side_are_no_corners():
    weights = np.full((40, 40), BASE_WEIGHT)
    for y in range(10, 30):
        weights[y, 5 : y + 1] = 1.0
    assert set(map(tuple, polygons_of(weights, 0.5).corners.tolist())) == {(4, 9), (11, 9), (30, 28), (30, 30), (4, 30)}


def test_a_ring_keeps_its_outward_corners_and_deep_bays():
    bay = np.array([(0, 0), (9, 0), (9, 9), (6, 9), (6, 3), (3, 3), (3, 9), (0, 9)])
    assert np.array_equal(without_notches(bay, 1.0), bay)
    step = np.array([(0, 0), (9, 0), (9, 8), (8, 8), (8, 9), (0, 9)])
    assert np.array_equal(without_notches(step, 1.0), np.delete(step, 3, axis=0))


def test_a_map_without_obstacles_has_no_corners():
    polygons = polygons_of(np.full((3, 4), BASE_WEIGHT), 1.0)
    assert len(polygons.corners) == len(polygons.rings) == 0 and not polygons.owner.any()


def test_a_room_has_a_ring_inside():
    weights = drawn(
        "..........",
        ".########.",
        ".#......#.",
        ".#......#.",
        ".#......#.",
        ".########.",
        "..........",
    )
    polygons = polygons_of(weights, 0.5)
    assert len(polygons.rings) == 2 and len(polygons.obstacle_rings) == 2
    assert len(polygons.corners) == 8


@pytest.mark.parametrize("seed", range(20))
def test_the_sides_of_convex_obstacles_are_correct_paths(seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:60, 0:60]
    ellipse = ((x - 30) / rng.uniform(3, 20)) ** 2 + ((y - 30) / rng.uniform(3, 20)) ** 2 <= 1.0
    weights = np.where(ellipse, 1.0, BASE_WEIGHT)
    corners = polygons_of(weights, 0.5).corners
    assert first_fault(plain(weights), polyline(np.vstack((corners, corners[:1]))), False)[0] == 0
