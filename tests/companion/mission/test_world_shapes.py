"""Whether a rover that starts there touches something, told as the simulator's own drawing of the world tells it."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest
from PIL import Image

from companion.core.footprint import Footprint
from companion.mission.world_shapes import touches_obstacle
from sitl.plant.outline import Outline, OutlinePose, room_m
from sitl.world.world_file import load_world

WORLD = """size_m = [12.0, 9.0]
[[obstacle]]
line_m = [[1.0, 2.0], [6.0, 4.5]]
width_m = 0.3
[[obstacle]]
north_m = 6.0
east_m = 9.0
radius_m = 0.8
[[obstacle]]
polygon_m = [[1.0, 7.0], [3.0, 7.0], [3.0, 9.0]]
material = "glass"
"""
ROVER = Footprint.circle(0.35)


def touches(path: Path, place_m: tuple[float, float]) -> bool:
    return touches_obstacle(path, tomllib.loads(path.read_text()), ROVER, place_m)


def test_it_refuses_nothing_that_the_simulator_takes_and_hardly_less_than_it(tmp_path: Path) -> None:
    path = tmp_path / "w.toml"
    path.write_text(WORLD)
    solid, outline = load_world(path).layers().solid, Outline(0.35)
    places = [(0.25 + 0.57 * row, 0.25 + 0.61 * column) for row in range(15) for column in range(19)]
    told = [place for place in places if touches(path, place)]
    refused = [place for place in places if room_m(solid, outline, OutlinePose(*place, 0.0), 0.0) < 0.0]
    assert set(told) <= set(refused)
    assert len(told) > 0.8 * len(refused), (len(told), len(refused))


def test_the_map_underneath_counts_too(tmp_path: Path) -> None:
    picture = Image.new("L", (10, 5), 255)
    picture.putpixel((3, 4), 0)  # the bottom row is the south
    picture.save(tmp_path / "m.png")
    path = tmp_path / "w.toml"
    path.write_text('base = "m.png"\nbase_resolution_m = 2.0\n')
    assert touches(path, (1.0, 7.0)) and not touches(path, (3.0, 7.0)) and not touches(path, (1.0, 90.0))


@pytest.mark.parametrize(
    "text",
    ['base = "none.png"', 'base = "w.toml"', "obstacle = 3", "[[obstacle]]\nline_m = [[0, 0], [9, 9]]", "[[door]]"],
)
def test_what_has_a_mistake_in_it_is_left_to_the_simulator(tmp_path: Path, text: str) -> None:
    path = tmp_path / "w.toml"
    path.write_text(text)
    assert not touches(path, (1.0, math.pi))
