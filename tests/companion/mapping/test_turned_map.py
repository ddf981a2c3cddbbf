"""Turned maps: quarter turns are exact, no obstacle is lost at any angle, and none appears where there is none."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Grid
from companion.mapping.map_files import MapError, load_map
from companion.mapping.turned_map import turned
from tests.support.quick import examples
from tests.support.shared_data import SHARED

CORNER = NedPoint(3.0, -2.0)


def a_map(width: int, height: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weights = np.full((height, width), 0.5)
    weights[rng.random((height, width)) < 0.2] = OBSTACLE
    return weights


def squares(grid: Grid, weights: np.ndarray) -> list[shapely.Polygon]:
    """The obstacles as squares, x east and y north."""
    size_m, corner = grid.resolution_m, grid.south_west
    return [
        shapely.box(*(corner.east_m + x * size_m, corner.north_m + y * size_m), *(
            corner.east_m + (x + 1) * size_m, corner.north_m + (y + 1) * size_m))
        for y, x in zip(*np.nonzero(weights >= OBSTACLE), strict=True)
    ]  # fmt: skip


@pytest.mark.parametrize("quarters", [1, 2, 3, 4, -1])
def test_a_quarter_turn_moves_every_field_to_exactly_one(quarters: int) -> None:
    weights = a_map(7, 4, 1)
    weights[2, 3] = 0.3
    grid = turned(weights, 0.5, CORNER, quarters * math.pi / 2.0)
    # Rows grow north, so numpy turns the other way.
    assert np.array_equal(grid.weights, np.rot90(weights, -quarters))


@settings(max_examples=examples(60), deadline=None)
@given(yaw_rad=st.floats(-7.0, 7.0), seed=st.integers(0, 1000), size=st.tuples(st.integers(1, 9), st.integers(1, 9)))
def test_no_obstacle_is_lost_and_none_is_far_from_one(yaw_rad: float, seed: int, size: tuple[int, int]) -> None:
    weights = a_map(*size, seed)
    grid = turned(weights, 0.5, CORNER, yaw_rad)
    before = Grid(weights, 0.5, CORNER)
    pivot = (CORNER.east_m, CORNER.north_m)
    there = [affinity.rotate(one, yaw_rad, origin=pivot, use_radians=True) for one in squares(before, weights)]
    now = shapely.union_all(squares(grid, grid.weights))
    assert all(one.difference(now).area < 1e-4 for one in there)
    old = shapely.union_all(there)
    assert all(one.intersection(old).area > 0.0 for one in squares(grid, grid.weights))


def test_the_weight_of_free_ground_is_that_at_the_middle_and_outside_is_unknown() -> None:
    grid = turned(np.full((10, 10), 0.2), 1.0, NedPoint(0.0, 0.0), math.pi / 4.0)
    middle = grid.cell_at(NedPoint(7.0, 0.0))
    assert grid.weights[middle.y, middle.x] == 0.2 and grid.weights[0, 0] == 0.5
    assert grid.south_west.east_m == pytest.approx(-10.0 / math.sqrt(2.0)) and grid.south_west.north_m == 0.0


def yaml_of(tmp_path: Path, yaw: str) -> Path:
    (tmp_path / "room.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 254, 254, 254, 254, 254]))
    text = f"image: room.pgm\nresolution: 0.5\norigin: [1.0, 2.0, {yaw}]\nnegate: 0\n"
    (tmp_path / "room.yaml").write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return tmp_path / "room.yaml"


@pytest.mark.parametrize("yaw", ["1.5707963267948966", "1.5708", "-4.712"])
def test_a_turned_ros_map_is_read_about_its_origin(tmp_path: Path, yaw: str) -> None:
    """Also where the quarter turn was rounded."""
    grid = load_map(yaml_of(tmp_path, yaw))
    # The picture's top left corner lies north of the origin; a quarter turn takes it to the west.
    assert (grid.width, grid.height) == (2, 3) and grid.is_obstacle(grid.cell_at(NedPoint(2.25, 0.25)))
    assert int((grid.weights >= OBSTACLE).sum()) == 1
    assert grid.south_west.east_m == pytest.approx(0.0) and grid.south_west.north_m == pytest.approx(2.0)


def test_a_whole_turn_is_none(tmp_path: Path) -> None:
    grid = load_map(yaml_of(tmp_path, "6.283185307179586"))
    assert (grid.width, grid.height, grid.south_west) == (3, 2, NedPoint(2.0, 1.0))


def test_a_turned_map_that_grows_too_large_is_refused_in_one_line(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("companion.mapping.map_files.MAX_FIELDS", 8)
    with pytest.raises(MapError, match=r"room\.yaml: origin: turned by 0\.7 rad it needs more than 8 fields"):
        load_map(yaml_of(tmp_path, "0.7"))


@pytest.mark.parametrize("name", ["nav2/depot.yaml", "turtlebot3/map.yaml"])
def test_real_maps_keep_their_obstacles(name: str, tmp_path: Path) -> None:
    path = SHARED / "data" / "ros_maps" / name
    if not path.is_file():
        pytest.skip("the map is not there")
    plain = load_map(path)
    grid = turned(plain.weights, plain.resolution_m, plain.south_west, 0.4)
    y, x = np.nonzero(plain.weights >= OBSTACLE)
    east, north = (x + 0.5) * plain.resolution_m, (y + 0.5) * plain.resolution_m
    cos, sin = math.cos(0.4), math.sin(0.4)
    there = [
        grid.cell_at(
            NedPoint(plain.south_west.north_m + e * sin + n * cos, plain.south_west.east_m + e * cos - n * sin)
        )
        for e, n in zip(east, north, strict=True)
    ]
    assert all(grid.is_obstacle(cell) for cell in there)
