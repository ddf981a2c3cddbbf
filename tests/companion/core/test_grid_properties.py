"""A half-field offset between two conversions is the classic map bug: it must not survive here."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import GeoPoint, LocalFrame, NedPoint, wrap_pi_rad
from companion.core.grid import OBSTACLE, Cell, Grid, inflated

METRES = st.floats(-5000.0, 5000.0)
GRIDS = st.builds(
    lambda size, north, east: Grid(np.full((7, 9), 0.5), size, NedPoint(north, east)),
    st.sampled_from([0.05, 0.25, 0.3, 1.0, 2.0, 7.5]),
    METRES,
    METRES,
)
CELLS = st.builds(Cell, st.integers(-300, 300), st.integers(-300, 300))


@given(GRIDS, CELLS)
def test_a_fields_middle_lies_in_the_field(grid, cell):
    assert grid.cell_at(grid.centre_of(cell)) == cell


@given(GRIDS, METRES, METRES)
def test_a_place_is_at_most_half_a_field_from_the_middle_of_its_field(grid, north_m, east_m):
    place = NedPoint(north_m, east_m)
    middle = grid.centre_of(grid.cell_at(place))
    half_m = grid.resolution_m / 2.0 + 1e-9
    assert abs(middle.north_m - north_m) <= half_m and abs(middle.east_m - east_m) <= half_m


@given(GRIDS, CELLS, st.floats(0.02, 0.98), st.floats(0.02, 0.98))
def test_everything_between_a_fields_edges_belongs_to_it(grid, cell, share_x, share_y):
    size_m = grid.resolution_m
    place = NedPoint(
        grid.south_west.north_m + (cell.y + share_y) * size_m, grid.south_west.east_m + (cell.x + share_x) * size_m
    )
    assert grid.cell_at(place) == cell
    assert grid.contains(cell) == (0 <= cell.x < 9 and 0 <= cell.y < 7)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 4.0), st.floats(0.0, 0.3))
def test_inflation_is_the_distance_rule_and_nothing_else(seed, radius, share):
    """Against the rule itself, field by field."""
    weights = np.where(np.random.default_rng(seed).random((8, 11)) < share, OBSTACLE, 0.5)
    result = inflated(weights, radius)
    obstacles = [(x, y) for y, x in np.argwhere(weights >= OBSTACLE)]
    for y, x in np.ndindex(weights.shape):
        gaps = [math.hypot(max(abs(x - ox) - 0.5, 0.0), max(abs(y - oy) - 0.5, 0.0)) for ox, oy in obstacles]
        closed = weights[y, x] >= OBSTACLE or any(gap < radius for gap in gaps)
        assert (result[y, x] >= OBSTACLE) == closed


@given(st.floats(-85.0, 85.0), st.floats(-180.0, 179.99), METRES, METRES)
def test_local_to_geo_and_back(lat_deg, lon_deg, north_m, east_m):
    """Also across the 180th meridian."""
    frame = LocalFrame(GeoPoint(lat_deg, lon_deg))
    place = frame.to_geo(NedPoint(north_m, east_m))
    assert -180.0 <= place.lon_deg < 180.0
    assert frame.to_ned(place).distance_m(NedPoint(north_m, east_m)) < 1e-6 * 5000.0


@given(st.floats(-50.0, 50.0))
def test_wrapping_keeps_the_direction(angle):
    wrapped = wrap_pi_rad(angle)
    assert -math.pi <= wrapped <= math.pi  # pi itself only by rounding, just below -pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)


@given(METRES, METRES, st.floats(-math.pi, math.pi), st.floats(0.01, 1000.0))
def test_moving_along_a_bearing_is_found_again(north_m, east_m, bearing_rad, distance_m):
    here = NedPoint(north_m, east_m)
    there = here.moved(bearing_rad, distance_m)
    assert math.isclose(here.distance_m(there), distance_m, rel_tol=1e-6, abs_tol=1e-9)
    assert abs(wrap_pi_rad(here.bearing_rad(there) - bearing_rad)) < 1e-6
