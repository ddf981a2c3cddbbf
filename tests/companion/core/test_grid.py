import numpy as np
import pytest

from companion.core.frames import NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid, empty_grid, inflated
from tests.support.planning_maps import drawn


def test_fields_are_counted_from_the_south_west_corner():
    grid = empty_grid(4, 3, 2.0, NedPoint(north_m=-10.0, east_m=100.0))
    assert (grid.width, grid.height) == (4, 3)
    assert grid.cell_at(NedPoint(-10.0, 100.0)) == Cell(0, 0)
    assert grid.cell_at(NedPoint(-7.9, 100.1)) == Cell(0, 1), "y grows north"
    assert grid.cell_at(NedPoint(-9.9, 102.1)) == Cell(1, 0), "x grows east"
    assert grid.centre_of(Cell(0, 0)) == NedPoint(-9.0, 101.0)
    assert grid.cell_at(NedPoint(-10.001, 99.999)) == Cell(-1, -1), "no rounding towards zero"


@pytest.mark.parametrize(
    ("cell", "inside"),
    [((0, 0), True), ((3, 2), True), ((4, 0), False), ((0, 3), False), ((-1, 0), False), ((0, -1), False)],
)
def test_ground_outside_the_grid_counts_as_an_obstacle(cell, inside):
    grid = empty_grid(4, 3)
    assert grid.contains(Cell(*cell)) is inside
    assert grid.is_obstacle(Cell(*cell)) is not inside


def test_only_weight_one_is_an_obstacle():
    grid = Grid(np.array([[0.0, 0.5, 0.99, 1.0]]))
    assert [grid.is_obstacle(Cell(x, 0)) for x in range(4)] == [False, False, False, True]


def test_an_empty_grid_has_the_base_weight():
    grid = empty_grid(5, 2, 0.5)
    assert grid.weights.shape == (2, 5) and (grid.weights == BASE_WEIGHT).all() and grid.resolution_m == 0.5


@pytest.mark.parametrize(("width", "height", "size"), [(0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.0), (1, 1, float("nan"))])
def test_a_grid_without_fields_is_refused(width, height, size):
    with pytest.raises(ValueError, match="at least 1 x 1 fields"):
        empty_grid(width, height, size)


def test_with_weights_keeps_the_place():
    grid = empty_grid(3, 3, 2.0, NedPoint(5.0, 6.0))
    other = grid.with_weights(np.zeros((3, 3)))
    assert (other.resolution_m, other.south_west) == (2.0, NedPoint(5.0, 6.0)) and other.weights.max() == 0.0


@pytest.mark.parametrize(
    ("radius", "rows"),
    [
        (0.5, ("......", "......", "..#...", "......")),
        (0.6, ("......", "..#...", ".###..", "..#...")),
        (0.8, ("......", ".###..", ".###..", ".###..")),
        (1.6, (".###..", "#####.", "#####.", "#####.")),
    ],
)
def test_inflation_closes_fields_whose_middle_is_nearer_than_the_radius(radius, rows):
    """Measured to the square of the obstacle field: half a field straight on, 0.707 on the diagonal."""
    one = drawn("......", "......", "..#...", "......")
    before = one.copy()
    assert np.array_equal(inflated(one, radius), drawn(*rows))
    assert np.array_equal(one, before)


def test_inflation_keeps_other_weights():
    weights = np.array([[0.2, 0.3, OBSTACLE, 0.9, 0.1]])
    assert inflated(weights, 0.7).tolist() == [[0.2, 1.0, 1.0, 1.0, 0.1]]
