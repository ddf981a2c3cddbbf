"""Points in sight of each other, samples of free ground, and paths pulled straight."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.papers.line_of_sight import free_samples, sees, shortened
from companion.planning.random_numbers import seeded
from companion.planning.raster import first_fault, polyline
from tests.support.chance import usual_counts
from tests.support.planning_maps import drawn
from tests.support.quick import examples


@st.composite
def lines(draw):
    """A random map and two of its fields, the first free."""
    width, height = draw(st.integers(1, 16)), draw(st.integers(1, 16))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    weights = np.where(rng.random((height, width)) < draw(st.sampled_from([0.05, 0.2])), 1.0, 0.5)
    ends = [(draw(st.integers(0, width - 1)), draw(st.integers(0, height - 1))) for _ in range(2)]
    weights[ends[0][1], ends[0][0]] = 0.5
    return weights, ends, draw(st.booleans())


@given(made=lines())
@settings(max_examples=examples(500), deadline=None)
def test_what_is_in_sight_can_be_driven_to(made):
    weights, ends, corner_cutting = made
    drivable = first_fault(weights, polyline(np.array(ends)), corner_cutting)[0] == 0
    assert sees(weights, *ends[0], *ends[1], corner_cutting) == drivable


def test_walls_and_corners_block_the_view():
    weights = drawn(
        "....",
        ".#..",
        "....",
    )
    assert sees(weights, 0, 0, 3, 0, False) and sees(weights, 0, 0, 0, 2, False)
    assert not sees(weights, 0, 0, 2, 2, False) and not sees(weights, 0, 0, 2, 2, True)  # through the obstacle
    assert not sees(weights, 0, 1, 1, 2, False)  # past its corner
    assert sees(weights, 0, 1, 1, 2, True)
    assert not sees(weights, 0, 1, 1, 1, False)  # the obstacle itself


def test_samples_are_free_and_uniform():
    """Each quarter of the free ground gets its share, with bounds that one run in 100000 would break by chance."""
    weights = np.full((20, 40), 0.5)
    weights[:, 5:15] = 1.0  # 15 of the 30 free columns are left of column 25
    samples = free_samples(weights, 4000, seeded(1))
    assert samples.shape == (4000, 2) and (weights[samples[:, 1], samples[:, 0]] < 1.0).all()
    low, high = usual_counts(4000, 0.25)
    for left in (True, False):
        for lower in (True, False):
            inside = ((samples[:, 0] < 25) == left) & ((samples[:, 1] < 10) == lower)
            assert low <= inside.sum() <= high


def test_where_hardly_anything_is_free_there_are_fewer_samples():
    weights = np.ones((100, 100))
    assert len(free_samples(weights, 30, seeded(0))) == 0
    weights[3, 7] = 0.5
    samples = free_samples(weights, 30, seeded(0))
    assert len(samples) < 30 and all(tuple(sample) == (7, 3) for sample in samples)


@given(seed=st.integers(0, 2**32 - 1), corner_cutting=st.booleans())
@settings(max_examples=examples(200), deadline=None)
def test_a_path_pulled_straight_stays_one_and_gets_no_longer(seed, corner_cutting):
    rng = np.random.default_rng(seed)
    weights = np.where(rng.random((12, 12)) < 0.15, 1.0, 0.5)
    points = [tuple(rng.integers(12, size=2))]
    for _ in range(30):
        there = rng.integers(12, size=2)
        if sees(weights, *points[-1], *there, corner_cutting):
            points.append(tuple(there))
    before = np.array(points, np.int64)
    after = shortened(weights, before, corner_cutting)
    assert tuple(after[0]) == points[0] and tuple(after[-1]) == points[-1]
    later = iter(points)
    assert all(tuple(point) in later for point in after)  # in their order, none new
    for one, other in pairwise(after):
        assert sees(weights, *one, *other, corner_cutting)
    lengths = [np.hypot(*np.diff(nodes, axis=0).T).sum() for nodes in (after, before)]
    assert lengths[0] <= lengths[1] + 1e-9


def test_on_open_ground_only_the_ends_are_left():
    points = np.array([(0, 0), (5, 1), (3, 7), (9, 9)])
    assert shortened(np.full((10, 10), 0.5), points, False).tolist() == [[0, 0], [9, 9]]
