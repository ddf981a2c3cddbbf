import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import NedPoint
from companion.core.grid import Grid
from sitl.world.world import World
from tests.support.rays import ray_m


def one_block() -> World:
    """An obstacle 1 m x 1 m whose south-west corner lies at north 5, east 3."""
    obstacles = np.zeros((10, 10), dtype=np.bool_)
    obstacles[5, 3] = True
    return World(obstacles)


@pytest.mark.parametrize(
    ("north_m", "east_m", "bearing_deg", "length_m"),
    [
        (0.5, 3.5, 0, 4.5),
        (9.5, 3.5, 180, 3.5),
        (5.5, 0.5, 90, 2.5),
        (5.5, 9.0, 270, 5.0),
        (2.5, 0.5, 45, math.hypot(2.5, 2.5)),
        (-4.0, 3.5, 0, 9.0),
        (0.5, 3.5, 180, 20.0),
        (0.5, 2.9, 0, 20.0),
        (5.5, 3.5, 77, 0.0),
    ],
)
def test_rays_end_at_the_face_they_hit(north_m: float, east_m: float, bearing_deg: float, length_m: float) -> None:
    found_m = ray_m(one_block(), north_m, east_m, math.radians(bearing_deg), 20.0)
    assert found_m == pytest.approx(length_m, abs=1e-9)


def test_rays_are_no_longer_than_asked() -> None:
    assert ray_m(one_block(), 0.5, 3.5, 0.0, 4.4) == 4.4


def test_no_ray_slips_between_two_walls_that_meet_at_a_corner() -> None:
    obstacles = np.zeros((40, 40), dtype=np.bool_)
    obstacles[20, :] = True
    world = World(obstacles, resolution_m=0.1)
    for bearing_deg in np.linspace(-80.0, 80.0, 1601):
        bearing_rad = math.radians(bearing_deg)
        found_m = ray_m(world, 0.05, 2.0, bearing_rad, 30.0)
        reaches_m = 1.95 / math.cos(bearing_rad)
        if abs(reaches_m * math.sin(bearing_rad)) < 1.99:
            assert found_m == pytest.approx(reaches_m, abs=1e-9)


worlds = st.integers(0, 2**32 - 1).map(
    lambda seed: World(np.random.default_rng(seed).random((12, 15)) < 0.15, 0.5, -2.0, 1.0)
)
places = st.tuples(st.floats(-4.0, 6.0), st.floats(-1.0, 10.0))


@given(worlds, places, st.floats(-4.0, 4.0))
def test_rays_agree_with_small_steps(world: World, place: tuple[float, float], bearing_rad: float) -> None:
    """Everything before the hit is free, and an obstacle begins there: looked up with none of the code under test."""

    def blocked(distance_m: float) -> bool:
        x = math.floor((place[1] + distance_m * math.sin(bearing_rad) - world.west_m) / world.resolution_m)
        y = math.floor((place[0] + distance_m * math.cos(bearing_rad) - world.south_m) / world.resolution_m)
        inside = 0 <= y < world.obstacles.shape[0] and 0 <= x < world.obstacles.shape[1]
        return inside and bool(world.obstacles[y, x])

    found_m = ray_m(world, *place, bearing_rad, 8.0)
    assert 0.0 <= found_m <= 8.0
    # A ray that only grazes a corner may count either way: 1 mm of obstacle is what a step may miss.
    steps = np.arange(0.0, max(found_m - 1e-6, 0.0), 0.01)
    assert not any(blocked(step) and blocked(step + 1e-3) and blocked(max(step - 1e-3, 0.0)) for step in steps)
    if found_m < 8.0:
        assert blocked(found_m + 1e-7) or blocked(max(found_m - 1e-7, 0.0))


@given(worlds, places)
def test_clearance_is_the_distance_to_the_nearest_square(world: World, place: tuple[float, float]) -> None:
    nearest_m = 3.0
    for y, x in np.argwhere(world.obstacles):
        south_m, west_m = world.south_m + y * 0.5, world.west_m + x * 0.5
        gap_n = max(south_m - place[0], 0.0, place[0] - south_m - 0.5)
        gap_e = max(west_m - place[1], 0.0, place[1] - west_m - 0.5)
        nearest_m = min(nearest_m, math.hypot(gap_n, gap_e))
    assert world.clearance_m(*place, 3.0) == pytest.approx(nearest_m, abs=1e-9)


def test_a_grid_becomes_a_world_in_the_same_place() -> None:
    weights = np.full((3, 4), 0.5)
    weights[2, 1] = 1.0
    weights[0, 0] = 0.99
    world = World.from_grid(Grid(weights, 2.0, NedPoint(10.0, -20.0)))
    assert world.clearance_m(15.0, -17.0, 5.0) == 0.0
    assert ray_m(world, 11.0, -17.0, 0.0, 50.0) == pytest.approx(3.0)
    assert (world.width_m, world.height_m) == (8.0, 6.0)


def test_open_ground_has_no_obstacle() -> None:
    assert ray_m(World.open(), 0.0, 0.0, 1.0, 100.0) == 100.0
    assert World.open(50.0, 20.0).clearance_m(3.0, 3.0, 9.0) == 9.0
