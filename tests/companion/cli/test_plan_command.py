import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.cli.images import (
    CURVE_COLOUR,
    HEADING_COLOUR,
    OBSTACLE_COLOUR,
    PATH_COLOUR,
    START_COLOUR,
    TARGET_COLOUR,
    TIGHT_COLOUR,
)
from companion.planning.line_to_drive import tightest_radius, too_tight

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


def shown(output):
    """The rows of a table as a dict."""
    rows = (line.strip("│ ").split("│") for line in output.splitlines() if line.startswith("│"))
    return {name.strip(): text.strip() for name, text in rows}


def test_the_length_of_the_fields_and_of_the_line_to_drive_are_told_apart():
    ends = ("missions/maps/rooms.png", "--start", "0,24", "--target", "98,24")
    table = shown(run(*ends, "--planner", "theta-star").output)
    assert table["from field to field"] == "126.12 fields, 126.12 m"
    assert table["line to drive"] == "118.85 fields, 118.85 m", "docs/planners.md has it too"
    assert "the same" in shown(run(*ends, "--planner", "astar").output)["line to drive"]
    answer = json.loads(run(*ends, "--planner", "theta-star", "--json").stdout)
    assert answer["length_m"] == pytest.approx(126.12, abs=0.01)
    assert answer["curve_length_m"] == pytest.approx(118.85, abs=0.01)


def test_what_a_search_tried_is_called_what_it_is():
    ends = ("missions/maps/one-obstacle.png", "--start", "0,24", "--target", "98,24")
    for planner, words in (("prm", "lines looked at"), ("achour", "segments weighed"), ("bspline-ga", "chromosomes")):
        assert shown(run(*ends, "--planner", planner).output)["search"].endswith(words)
    assert "search" not in shown(run(*ends, "--planner", "astar").output)


@pytest.mark.parametrize("heading_deg", [0, 90, 180])
def test_a_rover_that_cannot_turn_on_the_spot_sets_out_ahead_and_in_wide_bends(heading_deg):
    ends = ("missions/maps/one-obstacle.png", "--start", "20,24", "--target", "90,24")
    turning = ("--turning-radius-m", "3", "--heading-deg", heading_deg)
    for planner in ("bspline-ga", "hybrid"):
        table = shown(run(*ends, *turning, "--planner", planner).output)
        assert table["sets out"] == "ahead"
        answer = json.loads(run(*ends, *turning, "--planner", planner, "--json").stdout)
        assert answer["sharpest_bend_m"] > 2.9
        assert table["sharpest bend"] == f"{answer['sharpest_bend_m']:.2f} m radius"


def test_a_line_that_such_a_rover_cannot_drive_is_said_to_be_none():
    turning = ("--turning-radius-m", "3", "--heading-deg", "180")
    result = run("missions/maps/rooms.png", "--start", "0,24", "--target", "98,24", *turning)
    assert result.exit_code == 0
    assert "too tight" in result.output and "off its heading" in result.output


def test_the_sharpest_bend_of_a_circle_is_its_radius():
    angles = np.linspace(0.0, 3.0, 40)
    circle = 5.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    assert tightest_radius(circle) == pytest.approx(5.0, rel=1e-3)
    assert tightest_radius(np.column_stack((angles, 2.0 * angles))) == np.inf


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
        (["--start", "0,0", "--target", "7,0", "--planner", ""], ["unknown planner ''"]),
        (["--start", "0,0", "--target", "7,0", "--heading-deg", "90"], ["--heading-deg 90", "--turning-radius-m"]),
        (["--start", "0,0", "--target", "7,0", "--turning-radius-m", "inf"], ["--turning-radius-m", "finite"]),
        (
            ["--start", "0,0", "--target", "7,0", "--turning-radius-m", "2", "--planner", "astar"],
            ["astar does not heed", "bspline-ga and hybrid"],
        ),
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
    pixels = np.array(Image.open(file).convert("RGB"))

    def middle(colour):
        """Row and column of the middle of the largest spots of this colour, the legend's left out."""
        rows, columns = np.nonzero((pixels[: int(0.85 * len(pixels))] == colour).all(axis=2))
        assert len(rows) > 50
        return rows.mean(), columns.mean()

    (south, west), (north, east) = middle(START_COLOUR), middle(TARGET_COLOUR)
    field = (east - west) / 7.0
    assert field > 50 and (south - north) / 5.0 == pytest.approx(field, rel=0.02)
    row, column = middle(OBSTACLE_COLOUR)  # fields 3, 0 to 3, 2, less where the curve passes
    assert (column - west) / field == pytest.approx(3.0, abs=0.1) and (south - row) / field == pytest.approx(
        1.0, abs=0.1
    )
    for colour in (PATH_COLOUR, CURVE_COLOUR):
        middle(colour)
    assert f"picture: {file}" in result.stdout


@pytest.mark.parametrize("heading_deg", [0, 90, 200])
def test_the_heading_at_the_start_is_an_arrow_of_the_picture(tmp_path, heading_deg):
    file = tmp_path / "heading.png"
    ends = ("missions/maps/rooms.png", "--start", "3,24", "--target", "6,40", "--turning-radius-m", "1")
    assert run(*ends, "--heading-deg", heading_deg, "--image", file).exit_code == 0
    pixels = np.array(Image.open(file).convert("RGB"))
    pixels = pixels[: int(0.85 * len(pixels))]  # the legend is below

    def middle(colour):
        rows, columns = np.nonzero((pixels == colour).all(axis=2))
        assert len(rows) > 50
        return rows.mean(), columns.mean()

    (down, right), (from_down, from_right) = middle(HEADING_COLOUR), middle(START_COLOUR)
    drawn_deg = np.degrees(np.arctan2(right - from_right, from_down - down))
    assert (drawn_deg - heading_deg + 180) % 360 - 180 == pytest.approx(0.0, abs=12.0)


def test_where_the_rover_cannot_follow_is_marked_and_counted(tmp_path):
    ends = ("missions/maps/rooms.png", "--start", "0,24", "--target", "98,24")

    def marks(radius_m):
        file = tmp_path / f"{radius_m}.png"
        result = run(*ends, "--turning-radius-m", radius_m, "--image", file)
        bends = shown(result.output)["too tight"].split()[0]
        pixels = np.array(Image.open(file).convert("RGB"))
        return bends, int((pixels == TIGHT_COLOUR).all(axis=2).sum())

    assert marks("0.1") == ("no", 0)
    bends, marked = marks("3")
    assert int(bends) > 5 and marked > 100 * int(bends) / 3


def test_a_bend_that_is_too_tight_is_counted_once_at_its_sharpest():
    right = np.concatenate([np.column_stack((np.arange(10.0), np.zeros(10))), [[9.0, 1.0], [9.0, 2.0]]])
    assert too_tight(right, 3.0).tolist() == [[9.0, 0.0]]
    assert too_tight(right, 0.5).shape == too_tight(right[:5], 3.0).shape == (0, 2)
    angles = np.linspace(0.0, 3.0, 40)
    circle = 2.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    assert len(too_tight(circle, 3.0)) == 1 and len(too_tight(circle, 2.0)) == 0
    doubled = np.repeat(right, 2, axis=0)
    assert too_tight(doubled, 3.0).tolist() == [[9.0, 0.0]]


def test_the_rovers_radius_and_the_size_of_fields_count(map_file):
    ends = (map_file, "--start", "0,0", "--target", "7,0", "--planner", "dijkstra", "--json")
    plain = json.loads(run(*ends).stdout)
    wide = json.loads(run(*ends, "--resolution-m", "0.5", "--radius-m", "0.6").stdout)
    assert wide["length_m"] < plain["length_m"] and wide["length_fields"] > plain["length_fields"]
    assert run(*ends, "--radius-m", "5").exit_code == 2, "the start would be too near to the wall"


def test_a_ros_map_says_its_field_size_itself(tmp_path):
    file = tmp_path / "m.yaml"
    result = run(file, "--start", "0,0", "--target", "7,0", "--resolution-m", "0.5")
    assert result.exit_code == 2
    assert result.output == f"{file}: --resolution-m: a ROS map says this itself: resolution\n"


LIAR = """
import dataclasses
from companion.planning.graph_search.astar import Astar
from companion.planning.problem import Path

class Liar(Astar):
    name = "liar"

    def plan(self, problem, budget, rng):
        result = super().plan(problem, budget, rng)
        path = result.path
        cells = path.cell_array if self.whole else path.cell_array[[0, -1]]
        return dataclasses.replace(result, planner="liar", path=Path(cells, 0.125))

    whole = True

class Jumper(Liar):
    whole = False

class Failing(Liar):
    def plan(self, problem, budget, rng):
        raise KeyError("nothing")
"""


def test_the_cost_is_not_what_a_planner_of_ones_own_says(map_file, tmp_path, monkeypatch):
    (tmp_path / "liars.py").write_text(LIAR)
    monkeypatch.syspath_prepend(tmp_path)
    ends = (map_file, "--start", "0,0", "--target", "7,0")
    honest = json.loads(run(*ends, "--planner", "astar", "--json").stdout)
    answer = json.loads(run(*ends, "--planner", "liars:Liar", "--json").stdout)
    assert answer["cost"] == pytest.approx(honest["cost"]) and answer["cost"] > 1.0
    assert (answer["wrong_cost_of_planner"], honest["wrong_cost_of_planner"]) == (0.125, None)
    table = shown(run(*ends, "--planner", "liars:Liar").output)
    assert float(table["cost"]) == pytest.approx(honest["cost"], abs=1e-3)
    assert table["planner's cost"].startswith("0.125, wrong")
    for name, words in (("Jumper", "its path is none: not adjacent, at its field 1"), ("Failing", "KeyError")):
        result = run(*ends, "--planner", f"liars:{name}")
        assert result.exit_code == 2 and words in result.stderr and result.stderr.count("\n") == 1
