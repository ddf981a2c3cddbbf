"""Our own mission files: what they say, and the one line for what they get wrong."""

from pathlib import Path

import pytest

from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mission.load import load_mission
from companion.mission.mission import (
    Area,
    GridSpec,
    HomePoint,
    MissionError,
    OnBlocked,
    RoverSpec,
    SitlSpec,
    Target,
    WeightedArea,
)

GRID = "[grid]\nsize = [100, 50]\nhome = [0, 24]\n"
TARGET = "[[target]]\nfield = [98, 24]\n"

WHOLE = """
name = "Everything"
prior_map = "known.map"
fence = "fence.waypoints"

[grid]
resolution_m = 0.5
size = [100, 50]
home = [0, 24]

[rover]
radius_m = 0.4
cruise_speed_m_s = 1.5

[[target]]
name = "gate"
field = [50, 24]
hold_s = 5
on_blocked = "wait"
speed_m_s = 1.0

[[target]]
north_m = 3.5
east_m = -0.2

[[target]]
lat_deg = 53.1326
lon_deg = 23.1689

[[keep_out]]
polygon_fields = [[10, 10], [20, 10], [20, 20]]

[[keep_out]]
north_m = 5.0
east_m = 6.0
radius_m = 2.0

[[keep_in]]
polygon_deg = [[53.0, 23.0], [53.0, 24.0], [54.0, 24.0], [54.0, 23.0], [53.0, 23.0]]

[[corridor]]
weight = 0.1
line_m = [[0, 0], [10, 0]]
width_m = 2.0

[[corridor]]
weight = 0.9
polygon_m = [[0, 0], [10, 0], [10, 10]]

[sitl]
world = "known.map"
resolution_m = 0.5
start = [0, 24]
heading_deg = 45.0
sensors = "beams"
home = { lat_deg = 50.0, lon_deg = 20.0 }
"""


def written(folder: Path, text: str) -> Path:
    (folder / "known.map").write_text("type octile\nheight 1\nwidth 1\nmap\n.\n")
    (folder / "fence.waypoints").write_text("QGC WPL 110\n0 0 0 5004 20 0 0 0 53 23 0 1\n")
    path = folder / "m.toml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(folder: Path, text: str) -> str:
    path = written(folder, text)
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ") and "\n" not in line
    return line.removeprefix(f"{path}: ")


def test_everything(tmp_path: Path) -> None:
    mission = load_mission(written(tmp_path, WHOLE))
    assert mission.name == "Everything"
    assert mission.grid == GridSpec(0.5, (100, 50), Cell(0, 24), None)
    assert mission.rover == RoverSpec(0.4, 1.5)
    assert mission.targets == (
        Target("gate", Cell(50, 24), 5.0, OnBlocked.WAIT, 1.0),
        Target("target 2", HomePoint(3.5, -0.2)),
        Target("target 3", GeoPoint(53.1326, 23.1689)),
    )
    assert mission.keep_out == (
        Area((Cell(10, 10), Cell(20, 10), Cell(20, 20))),
        Area((HomePoint(5.0, 6.0),), radius_m=2.0),
        Area((GeoPoint(53.0, 23.0),), radius_m=20.0),
    )
    assert len(mission.keep_in) == 1 and len(mission.keep_in[0].places) == 4
    assert mission.weighted == (
        WeightedArea(Area((HomePoint(0.0, 0.0), HomePoint(10.0, 0.0)), width_m=2.0), 0.1),
        WeightedArea(Area((HomePoint(0.0, 0.0), HomePoint(10.0, 0.0), HomePoint(10.0, 10.0))), 0.9),
    )
    known = tmp_path / "known.map"
    assert mission.prior_map == known
    assert mission.sitl == SitlSpec(known, 0.5, Cell(0, 24), 45.0, "beams", GeoPoint(50.0, 20.0))


def test_the_least_that_is_a_mission(tmp_path: Path) -> None:
    mission = load_mission(written(tmp_path, "[[target]]\nnorth_m = 10\neast_m = 0\n"))
    assert (mission.name, mission.grid, mission.rover) == ("m", GridSpec(by_footprint=True), RoverSpec())
    assert mission.targets == (Target("target 1", HomePoint(10.0, 0.0)),)
    assert mission.sitl is None


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "target: there is none"),
        ("nam = 'x'\n" + GRID + TARGET, "nam: unknown key"),
        (GRID + TARGET + "[[target]]\nfield = [1, 1]\nhold = 3\n", "target 2.hold: unknown key"),
        (GRID + TARGET + "[rover]\nradius_m = 'wide'\n", "rover.radius_m: must be a number"),
        (GRID + TARGET + "[rover]\nradius_m = 0\n", "rover.radius_m"),
        (GRID + TARGET + "[rover]\nradius_m = true\n", "rover.radius_m"),
        (GRID + TARGET + "speed_m_s = 0\n", "target 1.speed_m_s"),
        (GRID + TARGET + "hold_s = inf\n", "target 1.hold_s"),
        (GRID + TARGET + "hold_s = -1\n", "target 1.hold_s"),
        (GRID + TARGET + "on_blocked = 'cry'\n", "target 1.on_blocked: must be 'skip'"),
        (GRID + TARGET + 'name = "a\\nb"\n', "target 1.name"),
        (GRID + TARGET + '[grid."a\\nb"]\n', "grid.a\\nb: unknown key"),
        (GRID + "[[target]]\nname = 'x'\n", "target 1: has no place"),
        (GRID + "[[target]]\nnorth_m = 1\n", "target 1: north_m and east_m are both needed"),
        (GRID + "[[target]]\nlat_deg = 1\n", "target 1: lat_deg and lon_deg are both needed"),
        (GRID + TARGET + "north_m = 1\neast_m = 1\n", "target 1: a place is given twice"),
        (GRID + "[[target]]\nlat_deg = 91\nlon_deg = 0\n", "target 1: 91, 0 is not a latitude"),
        (GRID + "[[target]]\nfield = [1.5, 2]\n", "target 1.field 1"),
        (GRID + "[[target]]\nfield = [1, 2, 3]\n", "target 1.field"),
        (GRID + "[[target]]\nfield = [100, 24]\n", "target 1 'target 1': field 100, 24 is outside"),
        (GRID + "[[target]]\nfield = [0, -1]\n", "outside the grid"),
        (GRID + "[[target]]\nnorth_m = 0\neast_m = 99.6\n", "field 100, 24 is outside the grid"),
        (TARGET, "target 1 'target 1': a field needs [grid] size and home"),
        ("[grid]\nsize = [9, 9]\n" + TARGET, "grid.home: missing"),
        ("[grid]\nsize = [9, 9]\nhome = [9, 0]\n" + TARGET, "grid.home: field 9, 0 is outside"),
        ("[grid]\nsize = [0, 9]\nhome = [0, 0]\n" + TARGET, "grid.size 1"),
        ("[grid]\nsize = [9999, 9999]\nhome = [9, 0]\n" + TARGET, "is more than 4000000 fields"),
        ("[grid]\nresolution_m = 0\n" + TARGET, "grid.resolution_m"),
        (GRID + "margin_m = 3\n" + TARGET, "grid.margin_m"),
        (GRID + TARGET + "[[keep_out]]\n", "keep_out 1: exactly one shape is needed, not 0"),
        (GRID + TARGET + "[[keep_out]]\nfield = [1, 1]\n", "keep_out 1: a circle needs"),
        (GRID + TARGET + "[[keep_in]]\npolygon_m = [[0, 0], [1, 1]]\n", "keep_in 1: a polygon needs"),
        (
            GRID + TARGET + "[[keep_out]]\npolygon_fields = [[0, 0], [5, 5], [5, 0], [0, 5]]\n",
            "keep_out 1: not a simple polygon: its sides cross or touch",
        ),
        (GRID + TARGET + "[[keep_out]]\npolygon_m = [[0, 0], [5, 5], [9, 9]]\n", "keep_out 1: not a simple polygon"),
        (
            "[[target]]\nnorth_m = 1\neast_m = 1\n[[keep_out]]\npolygon_fields = [[0, 0], [5, 5], [5, 0]]\n",
            "keep_out 1: fields need [grid] size and home",
        ),
        (GRID + TARGET + "[[corridor]]\nweight = 1\nline_m = [[0, 0], [5, 5]]\nwidth_m = 1\n", "corridor 1.weight"),
        (GRID + TARGET + "[[corridor]]\nline_m = [[0, 0], [5, 5]]\nwidth_m = 1\n", "corridor 1.weight: is missing"),
        (GRID + TARGET + "[[corridor]]\nweight = 0\nline_m = [[0, 0], [5, 5]]\n", "corridor 1: a line needs"),
        (GRID + TARGET + "[[corridor]]\nweight = 0\nline_m = [[0, 0]]\nwidth_m = 1\n", "a line needs at least two"),
        ("[[target]]\nnorth_m = 1\nlat_deg = 50\n", "a place is given twice; use one of field"),
        ("prior_map = 'gone.yaml'\n" + GRID + TARGET, "gone.yaml: no such file; check the path"),
        ("fence = 'gone.plan'\n" + GRID + TARGET, "gone.plan: cannot be read"),
        (GRID + TARGET + "[sitl]\nworld = 'gone.png'\n", "gone.png: no such file; check the path"),
        (GRID + TARGET + "[sitl]\nheading_deg = 1e300\n", "sitl.heading_deg"),
        (GRID + TARGET + "[sitl.sensors]\nbeam = [{orientation = true, min_m = 0.1, max_m = 5}]\n", "not true"),
        (GRID + TARGET + "[sitl]\nstart = [0, 50]\n", "sitl.start: field 0, 50 is outside"),
    ],
)  # fmt: skip
def test_bad_files_get_one_line(tmp_path: Path, text: str, reason: str) -> None:
    assert reason in refusal(tmp_path, text)


def test_a_file_of_fences_that_cannot_be_read_is_told_with_the_mission_that_names_it(tmp_path: Path) -> None:
    assert "fence: " in refusal(tmp_path, "fence = 'gone.plan'\n" + GRID + TARGET)


def test_a_sensor_file_that_describes_none(tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text("")
    with pytest.raises(MissionError, match=r"empty\.toml: describes no sensor"):
        load_mission(written(tmp_path, GRID + TARGET + "[sitl]\nsensors = 'empty.toml'\n"))
