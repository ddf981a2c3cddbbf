"""World files: shapes become fields, surfaces become what rays meet, and bad files one line."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

from companion.core.grid import Cell
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from sitl.cli.commands import app
from sitl.scenario import ScenarioError, scenario_from_mission
from sitl.world.world import TOP_SPEED_M_S, World
from sitl.world.world_file import WorldTable, _Drawing, ground_grid, load_world
from tests.support.quick import examples
from tests.support.rays import ray_m

SIZE = "size_m = [20.0, 15.0]\n"
POST = "[[obstacle]]\nnorth_m = 10.0\neast_m = 5.0\nradius_m = 1.0\n"
PANE = "[[obstacle]]\nline_m = [[8.0, 0.0], [8.0, 20.0]]\nwidth_m = 0.2\n"
MISSIONS = Path(__file__).resolve().parents[3] / "missions"


def world_of(folder: Path, text: str) -> World:
    path = folder / "world.toml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def drawing(resolution_m: float = 0.1) -> _Drawing:
    fields = (round(15.0 / resolution_m), round(20.0 / resolution_m))
    return _Drawing(Path("x.toml"), np.zeros(fields, dtype=np.bool_), resolution_m)


def shape_of(text: dict[str, object]) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.bool_]], shapely.Geometry]:
    (item,) = WorldTable.model_validate({"size_m": [20.0, 15.0], "obstacle": [text]}).obstacle
    return drawing().covered("obstacle", 1, item), item.shape()


def test_places_are_north_and_east(tmp_path: Path) -> None:
    world = world_of(tmp_path, SIZE + POST)
    assert (world.width_m, world.height_m, world.resolution_m) == (pytest.approx(20.0), pytest.approx(15.0), 0.1)
    assert ray_m(world, 2.0, 5.0, 0.0, 12.0) == pytest.approx(7.0, abs=0.1)
    assert ray_m(world, 10.0, 15.0, -math.pi / 2.0, 12.0) == pytest.approx(9.0, abs=0.1)
    assert ray_m(world, 2.0, 15.0, 0.0, 12.0) == 12.0


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(1.0, 14.0), st.floats(1.0, 19.0)), min_size=3, max_size=6))
@example([(1.0, 3.0), (2.0, 1.16796875), (4.0, 4.0)])
def test_fields_cover_a_polygon_and_hardly_more(corners: list[tuple[float, float]]) -> None:
    hull = shapely.MultiPoint(corners).convex_hull
    if hull.geom_type != "Polygon" or hull.area < 0.01:
        return
    fields, shape = shape_of({"polygon_m": [list(corner) for corner in hull.exterior.coords[:-1]]})
    rows, columns = np.nonzero(fields)
    middles = shapely.points((columns + 0.5) * 0.1, (rows + 0.5) * 0.1)
    # A mitred sharp corner reaches farther than half a field; at five halves, a limit of shapely, the tip is cut.
    assert shapely.distance(shape, middles).max() <= math.hypot(5.0 * 0.05, 0.05) + 1e-6
    missed = shape.difference(
        shapely.union_all(shapely.box(columns * 0.1, rows * 0.1, columns * 0.1 + 0.1, rows * 0.1 + 0.1))
    )
    # A field whose middle is within half a field of the shape is filled. What is missed lies round a corner that
    # fields share, outside the circles in them: no circle in it has a radius above (sqrt 2 - 1) / 2 of a field.
    assert missed.buffer(-0.0208).is_empty


@settings(max_examples=40, deadline=None)
@given(st.floats(0.0, math.pi), st.floats(0.0, 2.0 * math.pi), st.floats(0.001, 0.3))
def test_no_ray_slips_through_a_thin_wall(turn_rad: float, bearing_rad: float, width_m: float) -> None:
    """A wall in whatever direction between two halves of the world; a ray that must cross it meets it where it is."""
    north, east = 5.0 * math.cos(turn_rad), 5.0 * math.sin(turn_rad)
    line = [[7.5 - north, 10.0 - east], [7.5 + north, 10.0 + east]]
    fields, _ = shape_of({"line_m": line, "width_m": width_m})
    world = World(fields, 0.1)
    aside = (7.5 - 2.0 * math.sin(turn_rad), 10.0 + 2.0 * math.cos(turn_rad))
    towards_rad = turn_rad - math.pi / 2.0 + 0.8 * math.sin(bearing_rad)
    expected_m = (2.0 - width_m / 2.0) / math.cos(0.8 * math.sin(bearing_rad))
    assert ray_m(world, *aside, towards_rad, 6.0) == pytest.approx(expected_m, abs=0.25)


def test_rays_go_through_glass_and_do_not_come_back_from_black(tmp_path: Path) -> None:
    behind = "[[obstacle]]\nline_m = [[12.0, 0.0], [12.0, 20.0]]\nwidth_m = 0.2\n"
    seen = {
        material: world_of(tmp_path, SIZE + PANE + f'material = "{material}"\n' + behind)
        for material in ("solid", "glass", "black")
    }
    ranges = {name: ray_m(world, 2.0, 10.0, 0.0, 15.0) for name, world in seen.items()}
    assert ranges["solid"] == pytest.approx(5.9, abs=0.1)
    assert ranges["glass"] == pytest.approx(9.9, abs=0.1)
    for world in seen.values():
        assert world.clearance_m(7.0, 10.0, 3.0) == pytest.approx(0.9, abs=0.1), "all of them are touched alike"
    straight = np.zeros((1, 1))
    assert seen["black"].rays_m(2.0, 10.0, straight, 15.0).tolist() == [15.0]
    # One ray of the sector passes beside the black wall's end: the nearest that comes back counts.
    short = PANE.replace("[8.0, 20.0]", "[8.0, 10.0]")
    half = world_of(tmp_path, SIZE + short + 'material = "black"\n' + behind)
    assert half.rays_m(2.0, 9.9, np.array([[0.0, 0.2]]), 15.0)[0] == pytest.approx(9.9 / math.cos(0.2), abs=0.15)


@pytest.mark.parametrize(("material", "sees"), [("solid", 5.9), ("glass", 7.5), ("black", 15.0)])
def test_what_moves_behind_a_surface_is_seen_through_glass_only(tmp_path: Path, material: str, sees: float) -> None:
    mover = "[[mover]]\nradius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[10.0, 10.0], [10.0, 12.0]]\nstart_s = 100.0\n"
    world = world_of(tmp_path, SIZE + PANE + f'material = "{material}"\n' + mover)
    assert world.rays_m(2.0, 10.0, np.zeros((1, 1)), 15.0)[0] == pytest.approx(sees, abs=0.1)
    before = world.rays_m(14.0, 10.0, np.full((1, 1), math.pi), 15.0)[0]
    assert before == pytest.approx(3.5, abs=1e-9), "before the surface it is seen whatever the surface is"


def test_doors_have_times_and_surfaces(tmp_path: Path) -> None:
    door = "[[door]]\nline_m = [[8.0, 0.0], [8.0, 20.0]]\nwidth_m = 0.2\nopen_s = [[5.0, 10.0], [20.0]]\n"
    world = world_of(tmp_path, SIZE + door)
    sees = [ray_m(world, 2.0, 10.0, 0.0, 12.0, time_s) < 12.0 for time_s in (0.0, 5.0, 10.0, 20.0, 1e6)]
    assert sees == [True, False, True, False, False]
    glass = world_of(tmp_path, SIZE + door + 'material = "glass"\n')
    assert ray_m(glass, 2.0, 10.0, 0.0, 12.0, 0.0) == 12.0
    assert glass.clearance_m(7.0, 10.0, 3.0, 0.0) == pytest.approx(0.9, abs=0.1)
    repeated = world_of(tmp_path, SIZE + door.replace(", [20.0]", "") + "period_s = 20.0\n")
    assert [d.is_open(t) for d in repeated.doors for t in (4.0, 7.0, 24.0, 27.0)] == [False, True, False, True]


def test_grip_falls_off_over_the_edge_and_the_worst_ground_counts(tmp_path: Path) -> None:
    ice = "[[slippery]]\npolygon_m = [[2.0, 2.0], [2.0, 18.0], [14.0, 18.0], [14.0, 2.0]]\ngrip = 0.2\nedge_m = 2.0\n"
    worse = "[[slippery]]\nnorth_m = 8.0\neast_m = 10.0\nradius_m = 1.0\ngrip = 0.1\n"
    rough = "[[rough]]\nnorth_m = 8.0\neast_m = 15.0\nradius_m = 1.0\ntop_speed_m_s = 1.0\n"
    grip, pace = world_of(tmp_path, SIZE + ice + worse + rough).ground
    assert grip[80, 10] == 1.0
    assert grip[80, 30] == pytest.approx(1.0 - 0.8 * 1.05 / 2.0, abs=0.01), "1.05 m within"
    assert grip[80, 60] == pytest.approx(0.2)
    assert grip[80, 100] == pytest.approx(0.1)
    assert pace[80, 150] == pytest.approx(1.0 / TOP_SPEED_M_S)
    assert pace[80, 100] == 1.0


def test_shapes_lie_over_a_map(tmp_path: Path) -> None:
    picture = np.full((10, 20), 255, dtype=np.uint8)
    picture[0, 5] = 0
    Image.fromarray(picture).save(tmp_path / "map.png")
    world = world_of(tmp_path, 'base = "map.png"\nbase_resolution_m = 2.0\nresolution_m = 0.5\n' + POST)
    assert world.obstacles.shape == (40, 80)
    assert world.obstacles[36:40, 20:24].all(), "the map's field, in the top row"
    assert world.obstacles[20, 10], "the post"
    assert world.obstacles.sum() == pytest.approx(16 + 16, abs=6)


def test_a_ros_map_says_how_large_its_fields_are(tmp_path: Path) -> None:
    Image.fromarray(np.full((10, 20), 254, dtype=np.uint8)).save(tmp_path / "map.pgm")
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.25\norigin: [-3, -2, 0]\nnegate: 0\n"
                                       "occupied_thresh: 0.65\nfree_thresh: 0.196\n")  # fmt: skip
    world = world_of(
        tmp_path, 'base = "map.yaml"\n[[rough]]\nnorth_m = 1.0\neast_m = 1.0\nradius_m = 0.5\ntop_speed_m_s = 1.0'
    )
    assert world.resolution_m == pytest.approx(0.25 / 3)
    assert (world.width_m, world.height_m) == (pytest.approx(5.0), pytest.approx(2.5))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "size_m: [east, north] is needed"),
        (SIZE + "[[obstacle]]\n", "obstacle 1: exactly one of polygon_m, line_m and circle is needed, not 0"),
        (SIZE + POST + "polygon_m = [[1, 1], [1, 2], [2, 2]]\n", "obstacle 1: exactly one"),
        (SIZE + "[[obstacle]]\npolygon_m = [[1, 1], [1, 2]]\n", "obstacle 1.polygon_m"),
        (SIZE + "[[obstacle]]\npolygon_m = [[1, 1], [5, 5], [5, 1], [1, 5]]\n", "its sides cross or touch"),
        (SIZE + "[[obstacle]]\nline_m = [[1, 1], [1, 2]]\n", "a line needs line_m and width_m"),
        (SIZE + "[[obstacle]]\nnorth_m = 3.0\nradius_m = 1.0\n", "a circle needs north_m, east_m and radius_m"),
        (SIZE + POST.replace("10.0", "99.0"), "obstacle 1: lies outside the world, 20 m east and 15 m north"),
        (
            SIZE + "[[obstacle]]\nline_m = [[14.0, 1.0], [19.0, 1.0]]\nwidth_m = 0.3\n",
            "obstacle 1: lies mostly outside the world, 20 m east and 15 m north; size_m is [east, north]",
        ),
        (SIZE + POST + 'material = "wood"\n', "obstacle 1.material"),
        (SIZE + POST + "colour = 3\n", "unknown key"),
        (SIZE + POST.replace("obstacle", "door"), "door 1.open_s: is missing"),
        (SIZE + POST.replace("obstacle", "door") + "open_s = [[5.0, 5.0]]\n",
         "door 1: open_s: the span from 5 s ends at 5 s"),
        (SIZE + POST.replace("obstacle", "door") + "open_s = [[5.0]]\nperiod_s = 9.0\n", "goes beyond period_s"),
        (SIZE + POST.replace("obstacle", "door") + "open_s = [[1.0, 2.0], [1.5, 4.0]]\n",
         "from 1 s and from 1.5 s overlap; make"),
        (SIZE + POST.replace("obstacle", "door") + "open_s = [[5.0], [7.0, 8.0]]\n", "from 5 s and from 7 s overlap"),
        ("size_m = [10.0]\n", "size_m 2: is missing, and must be given; docs/worlds.md describes the file"),
        (SIZE + POST.replace("obstacle", "slippery") + "grip = 1.5\n", "slippery 1.grip"),
        (SIZE + POST.replace("obstacle", "rough") + "top_speed_m_s = 9.0\n", "rough 1.top_speed_m_s"),
        (SIZE + POST.replace("obstacle", "mover"), "mover 1"),
        (SIZE + "resolution_m = 0.01\nsize_m = 3", "not valid TOML"),
        ("size_m = [2000.0, 2000.0]\n", "choose larger ones"),
        ('base = "gone.png"\n', "world.toml: base: "),
        ('base = "gone.png"\n', "gone.png: no such file; check the path"),
        ('base = "world.toml"\n', "it must be a map"),
        ('base = "map.png"\nresolution_m = 0.3\n', "does not divide"),
        ('base = "map.png"\n' + SIZE, "already has a size"),
    ],
)  # fmt: skip
def test_a_bad_world_gets_one_line(tmp_path: Path, text: str, words: str) -> None:
    Image.fromarray(np.full((10, 20), 255, dtype=np.uint8)).save(tmp_path / "map.png")
    with pytest.raises(MapError) as caught:
        world_of(tmp_path, text)
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    mission = tmp_path / "mission.toml"
    mission.write_text(
        '[grid]\nsize = [20, 15]\nhome = [2, 2]\n[[target]]\nfield = [9, 2]\n[sitl]\nworld = "world.toml"\n'
    )
    for command in ("drive", "serve"):
        result = CliRunner().invoke(app, [command, str(mission)])
        assert result.exit_code == 2
        assert len(result.output.strip().splitlines()) == 1
        assert words in result.output


def mission_in(folder: Path, world: str, sitl: str = "") -> Path:
    (folder / "world.toml").write_text(world)
    path = folder / "mission.toml"
    path.write_text(
        f"[grid]\nresolution_m = 0.5\nsize = [40, 30]\nhome = [4, 4]\n[[target]]\nfield = [30, 4]\n[sitl]\n"
        f'world = "world.toml"\n{sitl}'
    )
    return path


def test_the_rover_stands_in_a_field_of_the_mission(tmp_path: Path) -> None:
    scenario = scenario_from_mission(load_mission(mission_in(tmp_path, SIZE + POST)))
    assert (scenario.start.north_m, scenario.start.east_m) == (2.25, 2.25)
    other = scenario_from_mission(
        load_mission(mission_in(tmp_path, SIZE + POST, "start = [10, 3]\nresolution_m = 1.0\n"))
    )
    assert (other.start.north_m, other.start.east_m) == (3.5, 10.5)


@pytest.mark.parametrize(
    ("world", "sitl", "words"),
    [
        (SIZE + POST.replace("10.0", "2.0").replace("5.0", "2.0"), "", "touches an obstacle"),
        (SIZE + POST, "start = [99, 3]\n", "lies outside"),
        (SIZE + "[[mover]]\nradius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[2.2, 2.2], [9, 9]]\n", "",
         "world.toml: mover 1: starts"),
    ],
)  # fmt: skip
def test_a_start_where_something_is_gets_one_line(tmp_path: Path, world: str, sitl: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        scenario_from_mission(load_mission(mission_in(tmp_path, world, sitl)))


def test_a_world_may_be_driven_without_a_mission(tmp_path: Path) -> None:
    (tmp_path / "world.toml").write_text(SIZE + POST)
    grid = ground_grid(tmp_path / "world.toml")
    assert (grid.width, grid.height, grid.resolution_m) == (20, 15, 1.0)
    assert {cell for cell in (Cell(x, y) for x in range(20) for y in range(15)) if grid.is_obstacle(cell)} <= {
        Cell(x, y) for x in (4, 5) for y in (9, 10)
    }
    arguments = ["drive", "--world", str(tmp_path / "world.toml"), "--start", "5,2", "--target", "5,13"]
    result = CliRunner().invoke(app, [*arguments, "--sensors", "lidar-360"])
    assert "--sensors" not in result.output
    assert result.exit_code == 0, result.output


def test_a_world_of_shapes_is_no_map_for_the_companion() -> None:
    arguments = ["drive", "--world", str(MISSIONS / "worlds" / "depot.toml"), "--start", "4,20", "--target", "9,20"]
    result = CliRunner().invoke(app, [*arguments, "--prior"])
    assert result.exit_code == 2
    assert "--prior" in result.output and len(result.output.strip().splitlines()) == 1


def test_mission_check_leaves_a_world_file_to_the_simulator() -> None:
    from companion.cli.commands import app as companion_app

    result = CliRunner().invoke(companion_app, ["mission", "check", str(MISSIONS / "depot.toml")])
    assert result.exit_code == 0
    assert "only rover-sitl checks" in " ".join(result.output.split())


EVERYTHING = """size_m = [6.0, 4.0]
[[obstacle]]
polygon_m = [[1.0, 1.0], [1.0, 2.0], [2.0, 1.5]]
material = "glass"
[[obstacle]]
line_m = [[0.5, 3.0], [3.0, 3.0]]
width_m = 0.4
[[door]]
north_m = 3.0
east_m = 5.0
radius_m = 0.5
open_s = [[1.0, 2.0], [5.0]]
[[slippery]]
polygon_m = [[1.0, 1.0], [1.0, 5.0], [3.0, 5.0]]
grip = 0.1
edge_m = 1.0
[[rough]]
line_m = [[0.5, 3.0], [3.0, 3.0]]
width_m = 0.4
top_speed_m_s = 0.8
[[mover]]
radius_m = 0.7
speed_m_s = 0.8
route_m = [[6.0, 5.0], [3.0, 5.0]]
"""
NUMBERS = st.sampled_from(
    ["0.0", "-1.0", "1e6", "-1e6", "1e-9", "nan", "inf", "1e308", "7", "0.1", "[]", "''", "true", "3.999999999"]
)


@settings(max_examples=examples(150), deadline=None)
@given(changes=st.lists(st.tuples(st.integers(0, 60), NUMBERS), min_size=1, max_size=3))
def test_whatever_numbers_stand_in_it_a_world_is_understood_or_refused(
    changes: list[tuple[int, str]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    pieces = re.split(r"(\d+\.\d+)", EVERYTHING)
    for which, number in changes:
        pieces[2 * (which % (len(pieces) // 2)) + 1] = number
    path = tmp_path_factory.getbasetemp() / "fuzzed.toml"
    path.write_text("".join(pieces))
    try:
        world = load_world(path)
    except MapError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert world.ground.min() > 0.0 and world.ground.max() <= 1.0
        assert ray_m(world, 0.1, 0.1, 0.5, 5.0, 3.0) >= 0.0


def test_a_shape_with_east_before_north_is_told_as_that(tmp_path):
    path = tmp_path / "world.toml"
    wall = "size_m = [40, 20]\n[[obstacle]]\nwidth_m = 0.5\nline_m = "
    for line, remedy in (
        ("[[25, 5], [34, 5]]", r"\[north, east\], are they"),
        ("[[45, 50], [46, 50]]", "move it inside"),
    ):
        path.write_text(f"{wall}{line}\n")
        with pytest.raises(MapError, match=remedy):
            load_world(path)
