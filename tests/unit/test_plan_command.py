import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.cli.plan_image import CURVE_COLOUR, OBSTACLE_COLOUR, PATH_COLOUR, START_COLOUR, TARGET_COLOUR

MAP = """type octile
height 6
width 8
map
........
........
........
...@....
...@....
...@....
"""


@pytest.fixture
def map_file(tmp_path):
    file = tmp_path / "wall.map"
    file.write_text(MAP, encoding="ascii")
    return file


def run(*arguments):
    return CliRunner().invoke(app, ["plan", *map(str, arguments)])


def test_a_path_is_found_and_described(map_file):
    result = run(map_file, "--start", "0,0", "--target", "7,0")
    assert result.exit_code == 0, result.output
    for word in ("found", "hybrid", "cost", "fields", "ms"):
        assert word in result.output


@pytest.mark.parametrize("planner", ["bspline-ga", "hybrid", "dijkstra"])
def test_json_holds_the_path_in_the_users_coordinates(map_file, planner):
    result = run(map_file, "--start", "0,0", "--target", "7,0", "--planner", planner, "--json")
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert answer["status"] == "found" and answer["planner"] == planner
    assert answer["path"][0] == [0, 0] and answer["path"][-1] == [7, 0]
    assert any(x == 3 and y >= 3 for x, y in answer["path"])
    assert answer["cost"] == pytest.approx(answer["length_fields"] / 2.0)
    assert answer["time_s"] > 0.0


def test_json_says_what_it_was_made_with(map_file, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text("[planner]\nmixing = 0.7\n", encoding="utf-8")
    result = run(map_file, "--start", "0,0", "--target", "7,0", "--seed", 5, "--settings", own, "--json")
    answer = json.loads(result.stdout)
    assert answer["seed"] == 5 and answer["settings"]["planner"]["mixing"] == 0.7
    assert answer["versions"]["numba"] and answer["versions"]["rover-companion"] != "not installed"


def test_top_left_counts_y_down(map_file):
    result = run(map_file, "--start", "0,5", "--target", "7,5", "--top-left", "--json")
    path = json.loads(result.stdout)["path"]
    assert path[0] == [0, 5] and path[-1] == [7, 5] and any(x == 3 and y <= 2 for x, y in path)


def test_the_seed_decides(map_file):
    def path(seed):
        output = run(map_file, "--start", "0,0", "--target", "7,0", "--seed", seed, "--json", "--planner", "bspline-ga")
        return json.loads(output.stdout)["path"]

    assert path(3) == path(3)


def test_no_path_is_exit_code_3(map_file, tmp_path):
    sealed = tmp_path / "sealed.map"
    sealed.write_text(MAP.replace("........", "...@...."), encoding="ascii")
    for planner, status in (("hybrid", "no-path"), ("dijkstra", "no-path"), ("bspline-ga", "budget-spent")):
        result = run(sealed, "--start", "0,0", "--target", "7,0", "--planner", planner, "--json")
        assert result.exit_code == 3
        answer = json.loads(result.stdout)
        assert answer["status"] == status and answer["path"] is None and answer["cost"] is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--start", "0,9", "--target", "7,0"], ["--start 0,9", "outside", "7,5"]),
        (["--start", "-1,0", "--target", "7,0"], ["--start -1,0", "outside"]),
        (["--start", "0,0", "--target", "3,2"], ["--target 3,2", "obstacle"]),
        (["--start", "0;0", "--target", "7,0"], ["--start 0;0", "two whole numbers"]),
        (["--start", "0,0,0", "--target", "7,0"], ["two whole numbers"]),
        (["--start", "0,0", "--target", "7,0", "--planner", "hibrid"], ["'hibrid'", "'hybrid'"]),
        (["--start", "0,0", "--target", "7,0", "--settings", "no-such.toml"], ["no-such.toml"]),
        (["--start", "0,0", "--target", "7,0", "--image", "/dev/null/a.png"], ["/dev/null/a.png"]),
        (["--start", "0,0", "--target", "7,0", "--image", "picture.none"], ["picture.none", ".png"]),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(map_file, arguments, words):
    result = run(map_file, *arguments)
    assert result.exit_code == 2
    assert result.stdout == "" and len(result.stderr.splitlines()) == 1
    assert all(word in result.stderr for word in words), result.stderr


def test_a_missing_map_is_one_line_and_exit_code_2(tmp_path):
    result = run(tmp_path / "none.map", "--start", "0,0", "--target", "1,1")
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1 and "none.map" in result.stderr


def test_the_picture_is_north_up_and_shows_map_path_and_ends(map_file, tmp_path):
    file = tmp_path / "path.png"
    result = run(map_file, "--start", "0,0", "--target", "7,5", "--image", file, "--planner", "bspline-ga", "--seed", 1)
    assert result.exit_code == 0, result.output
    pixels = np.array(Image.open(file))
    height, width, _ = pixels.shape
    scale = width // 8
    assert width == 8 * scale > 700 and height > 6 * scale, "and a legend below"

    def at(x, y):
        return tuple(pixels[6 * scale - int((y + 0.5) * scale), int((x + 0.5) * scale)])

    assert at(0, 0) == START_COLOUR and at(7, 5) == TARGET_COLOUR
    assert at(3, 2) == OBSTACLE_COLOUR and at(6, 0) not in (OBSTACLE_COLOUR, PATH_COLOUR)
    for colour in (PATH_COLOUR, CURVE_COLOUR):
        assert (pixels == colour).all(axis=2).sum() > 50
