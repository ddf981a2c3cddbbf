"""``rover-companion mission check``."""

from pathlib import Path

import pytest
from PIL import Image
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.core.frames import GeoPoint
from companion.executive.open_gaps import map_at_start, open_gap_m
from companion.mission.load import load_mission
from companion.settings import load_settings

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


SHIPPED = sorted(path for path in MISSIONS.iterdir() if path.suffix in (".toml", ".plan", ".waypoints"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_mission_is_understood(path: Path) -> None:
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 0
    assert "grid:" in result.output and "rover: " in result.output


def test_it_says_what_was_understood(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        'name = "[bold]yard[/bold]"\n[[target]]\nname = "gate"\nnorth_m = 5\neast_m = 2.5\n'
        'hold_s = 3\non_blocked = "wait"\n'
        "[[keep_out]]\nlat_deg = 53.0\nlon_deg = 23.0\nradius_m = 7\n"
        "[[keep_in]]\npolygon_m = [[-50, -50], [-50, 50], [50, 50]]\n"
        "[[corridor]]\nweight = 0.2\nline_m = [[0, 0], [5, 5]]\nwidth_m = 2\n"
    )
    output = CliRunner().invoke(app, ["mission", "check", str(path)]).output
    for text in (
        "[bold]yard[/bold]",
        "gate",
        "5 m north, 2.5 m east of home",
        "3 s",
        "wait",
        "keep out of a circle of 7 m round 53.0000000, 23.0000000",
        "keep inside a polygon of 3 corners",
        "weight 0.2 in a line 2 m wide",
    ):
        assert text in output


def test_a_bad_file_gets_one_line_and_exit_code_2(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nfeild = [1, 2]\n")
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2
    assert result.output == f"{path}: target 1.feild: unknown key, did you mean 'field'?\n"


def test_a_bad_world_is_found_too(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    (tmp_path / "w.png").write_bytes(b"nothing")
    path.write_text("[[target]]\nnorth_m = 5\neast_m = 2.5\n[sitl]\nworld = 'w.png'\n")
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2
    assert result.output.count("\n") == 1 and "w.png: header" in result.output


@pytest.mark.parametrize(
    ("north_m", "reason"),
    [(30.0, "target 1 'target 1': lies in"), (30000.0, "km is more ground than a rover can keep a map of")],
)
def test_a_mission_that_could_never_begin_is_refused(tmp_path: Path, north_m: float, reason: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        f"[[target]]\nnorth_m = {north_m}\neast_m = 0\n[[keep_out]]\nnorth_m = 30\neast_m = 0\nradius_m = 4\n"
    )
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2 and result.output.count("\n") == 1
    assert str(path) in result.output and reason in result.output


def test_commands_patrols_and_what_was_left_out(tmp_path: Path) -> None:
    path = tmp_path / "m.waypoints"
    rows = [
        "0 0 0 16 0 0 0 0 53.1 23.1 0 1",
        "1 0 3 22 0 0 0 0 53.1 23.1 5 1",
        "2 0 3 16 3 0 0 0 53.1001 23.1 0 1",
        "3 0 0 183 9 1900 0 0 0 0 0 1",
        "4 0 0 114 5 0 0 0 0 0 0 1",
        "5 0 3 201 0 0 0 0 53.2 23.2 0 1",
        "6 0 0 177 2 -1 0 0 0 0 0 1",
    ]
    path.write_text("\n".join(["QGC WPL 110", *rows]))
    refused = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert refused.exit_code == 2 and refused.output.endswith("--skip-unknown drives the rest\n")
    output = CliRunner().invoke(app, ["mission", "check", str(path), "--skip-unknown"]).output
    for text in (
        "command: DO_SET_SERVO 9 1900 3 s after arrival at waypoint 2",
        "command: DO_SET_ROI 0 0 (53.2000000, 23.2000000) within 5 m of the next target at waypoint 2",
        "patrol: from waypoint 2 to waypoint 2 until somebody ends it",
        "note: left out: item 1: NAV_TAKEOFF (22): no rover can do it",
    ):
        assert text in output


FAR = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t53.1325\t23.1688\t150\t1
1\t0\t3\t16\t0\t0\t0\t0\t53.1330\t23.1690\t0\t1
2\t0\t3\t16\t0\t0\t0\t0\t23.1700\t53.1330\t0\t1
3\t0\t3\t16\t0\t0\t0\t0\t53.2330\t23.1690\t0\t1
"""
WARNED = (
    "warning: target 2 'waypoint 2' is 4177 km from home; latitude and longitude seem swapped "
    "(the other way round it is 97 m away), is that meant?\n"
    "warning: target 3 'waypoint 3' is 11.2 km from home; is that meant?\n"
)


def checked(path: Path, *options: str) -> str:
    result = CliRunner().invoke(app, ["mission", "check", str(path), *options])
    assert result.exit_code == 0, result.output
    return result.output


def refused(path: Path) -> str:
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2 and result.output.count("\n") == 1, result.output
    return result.output


def test_it_warns_of_places_that_seem_wrong(tmp_path: Path) -> None:
    path = tmp_path / "far.waypoints"
    path.write_text(FAR.replace("23.1700\t53.1330", "53.1331\t23.1691").replace("53.2330", "53.1450"))
    assert checked(path).endswith("warning: target 3 'waypoint 3' is 1.4 km from home; is that meant?\n")
    path.write_text(FAR)
    said = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert said.exit_code == 2 and said.output.startswith(WARNED.splitlines()[1])
    assert WARNED.splitlines()[0].removeprefix("warning: ") in said.output.splitlines()[1]
    assert "warning" not in checked(MISSIONS / "field.plan")


def test_run_warns_in_the_same_words_before_it_opens_the_link(tmp_path: Path) -> None:
    path = tmp_path / "far.waypoints"
    path.write_text(FAR)
    result = CliRunner().invoke(app, ["run", str(path), "--connect", "nowhere", "--state", str(tmp_path / "state")])
    assert result.exit_code == 2 and WARNED in result.output


def test_it_says_how_large_fields_become_and_which_gaps_that_opens(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nnorth_m = 30\neast_m = 0\n")
    laid = "laid round home, targets and fences with a margin of 25 m (half its extent if that is more)"
    gaps = "the rover drives through gaps of 1.0 m or more, with single beams alone (fields of 1 m) of 2.4 m"
    assert f"grid: fields of 0.15 m (by the rover's size), {laid}; {gaps}\n" in checked(path)
    path.write_text("[[target]]\nnorth_m = 300\neast_m = 0\n")
    finer = checked(path)
    assert "and no more than 250000 of them), laid round" in finer
    assert "; for narrower gaps give [grid] resolution_m or a smaller margin_m\n" in finer
    path.write_text('[[target]]\nnorth_m = 30\neast_m = 0\n[sitl]\nsensors = "beams"\n')
    beams = checked(path)
    assert "fields of 1 m (as single beams need), laid round" in beams and "through gaps of 2.4 m or more\n" in beams
    path.write_text("[rover]\nturning_radius_m = 2\n[[target]]\nnorth_m = 30\neast_m = 0\n")
    arcs = checked(path)
    assert "fields of 0.25 m (by the rover's size), laid" in arcs and "gaps of 1.2 m or more, with single" in arcs


def test_it_checks_with_the_settings_that_the_mission_is_to_be_driven_with(tmp_path: Path) -> None:
    mission, settings = tmp_path / "m.toml", tmp_path / "faster.toml"
    mission.write_text("[rover]\nlength_m = 1.2\nwidth_m = 0.6\n[[target]]\nnorth_m = 30\neast_m = 0\n")
    settings.write_text('[guidance]\ncontroller = "motion-ga"\n')
    assert "gaps of 1.9 m or more, with single beams" in checked(mission) and "in --settings" in checked(mission)
    planned = checked(mission, "--settings", str(settings))
    assert (
        "gaps of 0.8 m or more, with single beams alone (fields of 1 m) of 3.0 m" in planned
        and "--settings" not in planned
    )
    mission.write_text(mission.read_text() + '[sitl]\nsensors = "beams"\n')
    assert "fields of 1 m (as single beams need)" in checked(mission, "--settings", str(settings))
    nowhere = CliRunner().invoke(app, ["mission", "check", str(mission), "--settings", str(tmp_path / "no.toml")])
    assert nowhere.exit_code == 2 and len(nowhere.output.splitlines()) == 1


@pytest.mark.parametrize(("side_m", "north_m"), [(0.3, 30), (0.25, 180)])
def test_with_fields_of_a_given_size_the_gaps_are_those_of_the_map_as_it_is_laid(
    tmp_path: Path, side_m: float, north_m: float
) -> None:
    """On the larger ground evidence is coarser than it is wanted."""
    mission, faster = tmp_path / "m.toml", tmp_path / "faster.toml"
    faster.write_text('[guidance]\ncontroller = "motion-ga"\n')
    rover = "[rover]\nlength_m = 0.9\nwidth_m = 0.7\n"
    target = f"[[target]]\nnorth_m = {north_m}\neast_m = {north_m}\n"
    mission.write_text(f"{rover}[grid]\nresolution_m = {side_m}\n{target}")
    evidence = map_at_start(load_mission(mission), load_settings(faster), GeoPoint(0.0, 0.0), narrow_sight=False)
    gap_m = open_gap_m(load_mission(mission).rover, evidence)
    told = checked(mission, "--settings", str(faster))
    assert (
        f"fields of {side_m:g} m, laid" in told and f"; the rover drives through gaps of {gap_m:.1f} m or more" in told
    )
    place = "lat_deg = 53.1\nlon_deg = 23.2\n"
    mission.write_text(f"{rover}[grid]\nresolution_m = {side_m}\n[[target]]\n{place}")
    elsewhere = checked(mission, "--settings", str(faster))
    assert f"fields of {side_m:g} m, laid" in elsewhere and "; the rover drives through gaps of " in elsewhere


@pytest.mark.parametrize(
    ("forward_m", "middle"),
    [(0.1, "0.1 m ahead of the centre"), (-0.1, "0.1 m behind the centre"), (0.0, "at the centre")],
)
def test_it_says_the_outline_by_which_a_slip_in_its_keys_is_seen(tmp_path: Path, forward_m: float, middle: str) -> None:
    path = tmp_path / "m.toml"
    rover = f"[rover]\nlength_m = 0.9\nwidth_m = 0.7\ncentre_forward_m = {forward_m}\n"
    path.write_text(f"{rover}[[target]]\nnorth_m = 30\neast_m = 0\n")
    output = checked(path)
    assert f"rover: 0.9 m long, 0.7 m wide, its middle {middle} of rotation, in a circle of radius 0." in output


def test_options_say_what_a_ground_stations_file_cannot() -> None:
    output = checked(MISSIONS / "field.plan", "--resolution-m", "0.5", "--radius-m", "0.6", "--speed", "1.5")
    assert "fields of 0.5 m, laid round" in output and "; the rover drives through gaps of 2.2 m or more\n" in output
    assert "rover: radius 0.6 m, cruises at 1.5 m/s" in output
    toml = MISSIONS / "rooms.toml"
    result = CliRunner().invoke(app, ["mission", "check", str(toml), "--radius-m", "0.6"])
    assert result.exit_code == 2
    assert result.output == f"{toml}: --radius-m: a TOML mission says this itself: [rover] radius_m\n"


def test_a_grid_that_is_too_large_names_the_place_that_makes_it_so(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nnorth_m = 30\neast_m = 0\n[[target]]\nnorth_m = 4000\neast_m = 0\n")
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2 and result.output.count("\n") == 1
    assert "target 2 'target 2' is 4.0 km from home; is that meant? If it is, use resolution_m = " in result.output


def test_what_drive_would_refuse_is_refused_here_too(tmp_path: Path) -> None:
    """A place that makes the ground too large, in a file with a planned home; a world in which nobody stands."""
    rows = [f"{n} 0 3 16 0 0 0 0 {lat} 23.2 0 1" for n, lat in enumerate((53.1, 53.1001, 13.2))]
    path = tmp_path / "far.waypoints"
    path.write_text("\n".join(["QGC WPL 110", *(row.replace(" ", "\t") for row in rows)]))
    output = refused(path)
    assert "target 2 'waypoint 2' is 4437 km from home; is that meant?" in output and "--resolution-m" not in output
    path = tmp_path / "m.toml"
    path.write_text('[[target]]\nnorth_m = 3\neast_m = 0\n[sitl]\nworld = "w.toml"\n')
    (tmp_path / "w.toml").write_text("size_m = [20.0, 16.0]\n")
    assert "sitl.start: missing; give the field of " in refused(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "size_m = [40, 20]\n[[obstacle]]\ncircle_m = [3, 4, 1]\n",
            "describes a world of the simulator, and no mission",
        ),
        ("[[target]]\nnorth_m = 18,0\neast_m = 1\n", "write 18.0 with a point, not with a comma"),
        (
            "[[target]]\nfield = [18,0, 3]\n[grid]\nsize = [100, 50]\nhome = [0, 24]\n",
            "target 1.field: 2 values are wanted (got [18, 0, 3]); decimals have a point, 18.0 and not 18,0",
        ),
        (
            '[[target]]\nnorth_m = 1\neast_m = 2\n[sitl]\nworld = "w.toml"\nstart = [200, 10]\n',
            "lies outside the world",
        ),
        ('[[target]]\nnorth_m = 1\neast_m = 2\n[sitl]\nworld = "w.png"\nstart = [30, 3]\n', "lies outside the world"),
        ('[[target]]\nnorth_m = 1\neast_m = 2\n[sitl]\nworld = "w.png"\nstart = [4, 3]\n', "4, 3 is an obstacle in"),
        (
            '[[target]]\nnorth_m = 1\neast_m = 2\n[sitl]\nworld = "w.toml"\nstart = [8, 3]\n',
            "sitl.start: field 8, 3 touches an obstacle of",
        ),
    ],
    ids=[
        "a world file",
        "a decimal comma",
        "a decimal comma in a list",
        "a start outside a world file",
        "a start outside a picture",
        "a start on a wall of a picture",
        "a start on a wall of a world file",
    ],
)
def test_mistakes_that_people_make_are_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "w.toml").write_text("size_m = [40, 20]\n[[obstacle]]\nline_m = [[2, 8.9], [5, 8.9]]\nwidth_m = 0.4\n")
    picture = Image.new("L", (30, 20), 255)
    picture.putpixel((4, 16), 0)
    picture.save(tmp_path / "w.png")
    path = tmp_path / "m.toml"
    path.write_text(text)
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert (result.exit_code, result.output.count("\n")) == (2, 1), result.output
    assert says in result.output and result.output.startswith(str(path))
    inside = path.with_name("inside.toml")
    inside.write_text(
        text.replace("200", "20")
        .replace("30, 3", "29, 3")
        .replace("[4, 3]", "[5, 3]")
        .replace("[8, 3]", "[9, 3]")
        .replace("18,0, 3", "18, 3")
        .replace("18,0", "18.0")
    )
    assert CliRunner().invoke(app, ["mission", "check", str(inside)]).exit_code == (2 if "size_m" in text else 0)


@pytest.mark.parametrize("world", ["w.toml", "w.png"])
def test_it_warns_of_targets_in_walls_and_outside_the_simulators_world(tmp_path: Path, world: str) -> None:
    (tmp_path / "w.toml").write_text("size_m = [30, 20]\n[[obstacle]]\nline_m = [[4, 5.5], [7, 5.5]]\nwidth_m = 1.0\n")
    picture = Image.new("L", (30, 20), 255)
    picture.putpixel((5, 14), 0)
    picture.save(tmp_path / "w.png")
    places = {"free": (1, 1), "in the wall": (4, 4), "far": (1, 90), "south": (-2, 0), "behind it": (8, 4)}
    targets = (
        f'[[target]]\nname = "{name}"\nnorth_m = {north_m}\neast_m = {east_m}\n'
        for name, (north_m, east_m) in places.items()
    )
    path = tmp_path / "m.toml"
    path.write_text(f'{"".join(targets)}[sitl]\nworld = "{world}"\nstart = [1, 1]\n')
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 0, result.output
    warned = [line.partition(" the simulator's world")[0] for line in result.output.splitlines() if "warning" in line]
    assert warned == [
        "warning: target 'in the wall' lies in an obstacle of",
        "warning: target 'far' lies outside",
        "warning: target 'south' lies outside",
    ]


@pytest.mark.parametrize("size", ['["a", 20]', "[30]", '"wide"', "[[30], 20]"])
def test_a_size_of_the_world_that_is_none_is_left_to_the_simulator(tmp_path: Path, size: str) -> None:
    (tmp_path / "w.toml").write_text(f"size_m = {size}\n")
    path = tmp_path / "m.toml"
    path.write_text('[[target]]\nnorth_m = 1\neast_m = 2\n[sitl]\nworld = "w.toml"\nstart = [3, 3]\n')
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 0, result.output


def test_it_says_that_another_controller_will_lead_the_rover(tmp_path: Path) -> None:
    settings = tmp_path / "faster.toml"
    settings.write_text('[guidance]\ncontroller = "motion-ga"\n')
    for name, said in (("ackermann.toml", True), ("clutter.toml", False)):
        output = CliRunner().invoke(app, ["mission", "check", str(MISSIONS / name), "--settings", str(settings)]).output
        text = "warning: guidance.controller: driving with points, not motion-ga: the rover turns in arcs"
        assert (text in output) is said, output
