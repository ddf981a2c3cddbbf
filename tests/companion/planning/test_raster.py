import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Cell, as_array, as_cells
from companion.planning.problem import Path, path_cost
from companion.planning.raster import (
    FAULTS,
    PathFault,
    cells_cost,
    first_fault,
    plain,
    polyline,
    without_loops,
)
from tests.support.paths import is_path
from tests.support.planning_maps import drawn

places = st.tuples(st.integers(-60, 60), st.integers(-60, 60))


@settings(deadline=None)  # the first call compiles
@given(places, places)
def test_a_line_is_connected_and_its_fields_are_the_nearest_to_it(start, end):
    cells = polyline(np.array([start, end]))
    assert tuple(cells[0]) == start and tuple(cells[-1]) == end
    steps = np.abs(np.diff(cells, axis=0)).max(axis=1)
    assert (steps == 1).all()
    length = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    assert len(cells) == length + 1
    exact = np.linspace(start, end, length + 1)
    assert np.abs(cells - exact).max() <= 0.5 + 1e-6


@settings(deadline=None)  # the first call compiles
@given(st.integers(1, 4000), st.integers(-4000, 4000))
def test_long_lines_do_not_drift(run, rise):
    cells = polyline(np.array([[0, 0], [run, rise]]))
    assert tuple(cells[-1]) == (run, rise)
    exact = np.linspace((0, 0), (run, rise), len(cells))
    assert np.abs(cells - exact).max() <= 0.5 + 1e-5


def test_no_wall_is_thin_enough_to_be_jumped():
    wall_x = 37
    for end_y in range(0, 50, 7):
        cells = polyline(np.array([[0, 24], [99, end_y]]))
        assert wall_x in cells[:, 0]


def test_joints_of_a_polyline_come_once():
    cells = polyline(np.array([[0, 0], [3, 0], [3, 0], [3, 2]]))
    assert as_cells(cells) == ((0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2))


def test_as_cells_makes_real_cells():
    cells = as_cells(np.array([[3, 4], [4, 4]]))
    assert cells == (Cell(3, 4), Cell(4, 4))
    assert type(cells[0]) is Cell and cells[0].x == 3 and cells[0].y == 4 and type(cells[0].x) is int
    assert as_cells(np.empty((0, 2), np.int64)) == ()


def test_loops_are_cut_out_and_the_ends_kept():
    walk = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [1, 0], [0, 1], [0, 2]])
    assert as_cells(without_loops(walk)) == ((0, 0), (1, 0), (0, 1), (0, 2))


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)]), max_size=60))
def test_a_walk_without_loops_visits_no_field_twice_and_stays_connected(steps):
    walk = np.cumsum(np.array([(0, 0), *steps]), axis=0)
    kept = without_loops(walk)
    assert tuple(kept[0]) == tuple(walk[0]) and tuple(kept[-1]) == tuple(walk[-1])
    assert len(set(as_cells(kept))) == len(kept)
    assert (np.abs(np.diff(kept, axis=0)).max(axis=1, initial=0) <= 1).all()
    assert set(as_cells(kept)) <= set(as_cells(walk))


def test_compiled_cost_is_path_cost():
    weights = np.random.default_rng(1).random((20, 20))
    weights[3, 3] = 0.0
    cells = polyline(np.array([[0, 0], [12, 5], [3, 3], [19, 19]]))
    assert cells_cost(weights, cells) == pytest.approx(path_cost(weights, as_cells(cells)), rel=1e-12)


@pytest.mark.parametrize(
    ("cells", "fault"),
    [
        ([(0, 0), (1, 0), (2, 0)], PathFault.NONE),
        ([(0, 2), (1, 3)], PathFault.OUTSIDE_MAP),
        ([(-1, 0), (0, 0)], PathFault.OUTSIDE_MAP),
        ([(0, 1), (1, 1)], PathFault.OBSTACLE),
        ([(0, 0), (2, 0)], PathFault.NOT_ADJACENT),
        ([(0, 0), (0, 0)], PathFault.NOT_ADJACENT),
        ([(0, 1), (1, 2)], PathFault.CORNER_CUT),
        ([(1, 0), (2, 1)], PathFault.CORNER_CUT),
    ],
)
def test_what_is_wrong_with_a_path(cells, fault):
    weights = drawn("...", ".#.", "...")
    number, index = first_fault(weights, np.array(cells), False)
    assert FAULTS[number] is fault
    assert (index >= 0) == (fault is not PathFault.NONE)
    assert is_path(weights, [Cell(*cell) for cell in cells]) == (fault is PathFault.NONE)
    assert is_path(weights, [Cell(*cell) for cell in cells], True) == (fault in (PathFault.NONE, PathFault.CORNER_CUT))


def test_plain_weights_are_passed_on_and_others_copied():
    weights = np.full((3, 4), 0.5)
    assert plain(weights) is weights
    frozen = weights.copy()
    frozen.flags.writeable = False
    for odd in (frozen, weights.T, weights.astype(np.float32), np.full((6, 8), 0.5)[::2, ::2]):
        copy = plain(odd)
        assert copy.flags.carray and copy.dtype == np.float64
        assert np.array_equal(copy, odd)


def test_as_array_of_nothing_has_two_columns():
    assert as_array([]).shape == (0, 2)


def test_a_path_has_its_fields_as_an_array_and_as_cells():
    cells = (Cell(0, 0), Cell(1, 1), Cell(2, 1))
    path = Path(cells, 1.2)
    assert path.cells == cells and path.cells is path.cells and isinstance(path.cells[0], Cell)
    assert path.cell_array.tolist() == [[0, 0], [1, 1], [2, 1]]
    assert path.length_fields == pytest.approx(1.0 + np.sqrt(2.0))
    again = pickle.loads(pickle.dumps(path))
    assert again.cells == cells and replace(again, cost=2.0).cells == cells and replace(again, cost=2.0).cost == 2.0
    with pytest.raises(FrozenInstanceError):
        path.cost = 3.0
    assert Path((cells[0],), 0.0).length_fields == 0.0 and Path((), 0.0).cells == ()
