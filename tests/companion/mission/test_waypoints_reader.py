"""QGC WPL files: every item is understood or refused by its name."""

from pathlib import Path

import pytest

from companion.core.frames import GeoPoint
from companion.mission.load import load_mission
from companion.mission.mission import HERE, Area, HomePoint, Mission, MissionError

HOME = "0 1 0 16 0 0 0 0 53.1 23.1 140 1"


def wpl(folder: Path, *items: str, header: str = "QGC WPL 110", newline: str = "\n") -> Path:
    path = folder / "m.waypoints"
    path.write_bytes(newline.join([header, *items]).encode())
    return path


def waypoint(index: int, lat: float = 53.2, lon: float = 23.2, hold: float = 0.0) -> str:
    return f"{index}\t0\t3\t16\t{hold}\t0\t0\t0\t{lat}\t{lon}\t0\t1"


def do(index: int, command: int, p1: float = 0, p2: float = 0, p3: float = 0, lat: float = 0, lon: float = 0) -> str:
    return f"{index}\t0\t3\t{command}\t{p1}\t{p2}\t{p3}\t0\t{lat}\t{lon}\t0\t1"


def refusal(path: Path) -> str:
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and "\n" not in text
    return text.removeprefix(f"{path}: ")


def names(mission: Mission) -> list[str]:
    return [target.name for target in mission.targets]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_wpl_forms_that_exist(tmp_path: Path, newline: str) -> None:
    path = wpl(
        tmp_path, "# home", HOME, "", "1   0 3  16 5 0 0 nan 53.2 23.2 0 1   # hold", waypoint(2), newline=newline
    )
    mission = load_mission(path)
    assert mission.planned_home == GeoPoint(53.1, 23.1)
    assert [(target.place, target.hold_s) for target in mission.targets] == [
        (GeoPoint(53.2, 23.2), 5.0),
        (GeoPoint(53.2, 23.2), 0.0),
    ]


def test_wpl_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = wpl(tmp_path, HOME, waypoint(1), header="\ufeffQGC WPL 110")
    assert names(load_mission(path)) == ["waypoint 1"]


def test_speed_hold_loiter_delay_and_return(tmp_path: Path) -> None:
    mission = load_mission(
        wpl(
            tmp_path,
            HOME,
            waypoint(1, hold=2),
            do(2, 178, 1, 1.5, -1),
            do(3, 19, 20, lat=53.3, lon=23.3),
            do(4, 93, 4),
            do(5, 178, 0, -2),
            waypoint(6),
            do(7, 20),
            do(8, 17),
        )
    )
    got = [(target.name, target.hold_s, target.speed_m_s) for target in mission.targets]
    assert got == [
        ("waypoint 1", 2.0, None),
        ("waypoint 3", 24.0, 1.5),
        ("waypoint 6", 0.0, None),
        ("home", 0.0, None),
        ("waypoint 8", 0.0, None),
    ]
    assert mission.targets[-2].place == HomePoint(0.0, 0.0) and mission.targets[-1].place == HERE
    assert any("NAV_LOITER_UNLIM (17)" in note for note in mission.notes)


def test_a_speed_of_minus_one_changes_nothing(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, do(1, 178, 1, 2.5), do(2, 178, 1, -1, 50), waypoint(3)))
    assert mission.targets[0].speed_m_s == 2.5
    assert any("throttle 50" in note for note in mission.notes)


def test_jumps_are_written_out(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), waypoint(2), do(3, 177, 1, 2), waypoint(4)))
    assert names(mission) == [
        "waypoint 1",
        "waypoint 2",
        "waypoint 1 pass 2",
        "waypoint 2 pass 2",
        "waypoint 1 pass 3",
        "waypoint 2 pass 3",
        "waypoint 4",
    ]


def test_a_jump_that_has_let_the_mission_pass_counts_anew(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), do(2, 177, 1, 1), do(3, 177, 1, 1)))
    assert len(mission.targets) == 4


def test_a_jump_of_no_repeats_does_nothing_and_forward_jumps_leave_out(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, do(1, 177, 3, 1), waypoint(2), waypoint(3), do(4, 177, 2, 0)))
    assert names(mission) == ["waypoint 3"]


def test_fences_may_stand_after_the_items(tmp_path: Path) -> None:
    corners = [(53.0, 23.0), (53.0, 23.5), (53.5, 23.5)]
    mission = load_mission(
        wpl(
            tmp_path,
            HOME,
            waypoint(1),
            *(do(2 + i, 5002, 3, lat=lat, lon=lon) for i, (lat, lon) in enumerate(corners)),
            do(5, 5003, 500, lat=53.1, lon=23.1),
            do(6, 5004, 20, lat=53.1, lon=23.1),
            do(7, 5000, lat=53.1, lon=23.1),
            do(8, 5100, lat=53.1, lon=23.1),
        )
    )
    assert mission.keep_out == (
        Area(tuple(GeoPoint(*corner) for corner in corners)),
        Area((GeoPoint(53.1, 23.1),), radius_m=20.0),
    )
    assert mission.keep_in == (Area((GeoPoint(53.1, 23.1),), radius_m=500.0),)
    assert len(mission.notes) == 2


@pytest.mark.parametrize(
    ("items", "reason"),
    [
        ([], "holds no items"),
        ([HOME], "target: there is none"),
        ([HOME, do(1, 22, lat=1, lon=1)], "item 1: NAV_TAKEOFF (22)"),
        ([HOME, waypoint(1), do(2, 21)], "item 2: NAV_LAND (21)"),
        ([HOME, do(1, 18, -1, lat=1, lon=1)], "item 1: NAV_LOITER_TURNS (18): -1 turns"),
        ([HOME, do(1, 18, 1)], "item 1: NAV_LOITER_TURNS (18): the centre of its circle"),
        ([HOME, waypoint(1), do(2, 194, 1)], "item 2: DO_SET_REVERSE (194): the companion drives forwards"),
        ([HOME, waypoint(1), do(2, 42702)], "item 2: NAV_SCRIPT_TIME (42702): only the autopilot itself"),
        ([HOME, waypoint(1), do(2, 31999)], "item 2: command 31999"),
        ([HOME, waypoint(1, lat=0, lon=0), do(2, 177, 1, -1)], "item 2: DO_JUMP (177): repeats for ever without"),
        ([HOME, waypoint(1), do(2, 181, 1, 1), do(3, 177, 2, -1)], "item 3: DO_JUMP (177): repeats for ever without"),
        ([HOME, waypoint(1), do(2, 177, 7, 1)], "no item 7"),
        ([HOME, waypoint(1), do(2, 177, 0, 1)], "no item 0"),
        ([HOME, waypoint(1), do(2, 177, 2, 1)], "item 2: DO_JUMP (177): jumps to itself"),
        ([HOME, waypoint(1), do(2, 177, 1, 1.5)], "1.5 repeats"),
        ([HOME, waypoint(1), do(2, 177, 1, 1e9)], "item 2: DO_JUMP (177): its jumps make this mission longer than"),
        ([HOME, do(1, 178, 1, 1), do(2, 177, 1, 1e9)], "longer than 10000 targets; give it fewer repeats, or -1 for"),
        ([HOME, waypoint(1), do(2, 177, 1, 3), do(3, 177, 1, 30000)], "item 3: DO_JUMP"),
        ([HOME, *map(waypoint, range(1, 10003))], "this mission is longer than 10000 targets; split it"),
        ([HOME, do(1, 178, 1, 0), waypoint(2)], "speed of 0"),
        ([HOME, do(1, 178, 2, 3), waypoint(2)], "kind 2"),
        ([HOME, waypoint(1, hold=-1)], "hold of -1 s; it is from 0 to 1000000 s"),
        ([HOME, waypoint(1, hold=1e30)], "a hold of 1e+30 s"),
        ([HOME, waypoint(1), do(2, 178, 0, 51)], "a speed of 51 m/s; give more than 0 and up to 50"),
        ([HOME, waypoint(1), do(2, 183, 1, -5)], "a pulse of -5 µs; it is from 0 (none) to 65535"),
        ([HOME, waypoint(1, lat=91)], "91.0, 23.2 is not a latitude"),
        ([HOME, "1 0 1 16 0 0 0 0 5 5 0 1"], "frame 1 (LOCAL_NED)"),
        ([HOME, waypoint(1), do(2, 112, 5), do(3, 93, 5)], "item 3: NAV_DELAY (93): a delay after a condition"),
        ([HOME, waypoint(1), do(2, 112, -5)], "a condition of -5"),
        ([HOME, waypoint(1), do(2, 601, 9, 1)], "no tag 9"),
        ([HOME, waypoint(1), do(2, 93, -1)], "time of day"),
        ([HOME, do(1, 17, lat=1, lon=1), waypoint(2)], "item 2: NAV_WAYPOINT (16): can never begin"),
        ([HOME, waypoint(1), do(2, 5002, 3, lat=1, lon=1)], "1 of its 3 corners"),
        ([HOME, waypoint(1), do(2, 5002, 2, lat=1, lon=1)], "polygon of 2 corners"),
        ([HOME, waypoint(1), do(2, 5004, 0, lat=1, lon=1)], "radius of 0"),
        ([HOME, waypoint(2)], "line 3: item 1 is expected"),
        ([HOME, "1 0 3 16 0 0 0 0 5 5 0"], "line 3: 12 values"),
        (
            [HOME, "1 0 3 16 0 0 0 0 5,5 5 0 1"],
            "line 3: latitude: expected a number, got '5,5'; write 5.5 with a point",
        ),
        ([HOME, "1 0 3 16 inf 0 0 0 5 5 0 1"], "line 3: p1"),
        ([HOME, "1 0 3 1_6 0 0 0 0 5 5 0 1"], "line 3: command"),
        ([HOME, "1 0 3 16.5 0 0 0 0 5 5 0 1"], "line 3: command"),
        (["0 0 0 16 0 0 0 0 95 0 0 1", waypoint(1)], "item 0: home"),
        ([do(0, 5004, 20, lat=1, lon=1)], "fences but no place"),
        ([do(0, 5100, lat=1, lon=1)], "target: there is none"),
    ],
)
def test_bad_wpl_files_get_one_line(tmp_path: Path, items: list[str], reason: str) -> None:
    assert reason in refusal(wpl(tmp_path, *items))


def test_a_crossing_fence_is_refused(tmp_path: Path) -> None:
    corners = ((53.0, 23.0), (53.1, 23.1), (53.1, 23.0), (53.0, 23.1))
    fence = [do(2 + i, 5001, 4, lat=lat, lon=lon) for i, (lat, lon) in enumerate(corners)]
    assert "keep_in 1: not a simple polygon" in refusal(wpl(tmp_path, HOME, waypoint(1), *fence))


def test_other_headers_and_suffixes_are_refused(tmp_path: Path) -> None:
    old = refusal(wpl(tmp_path, HOME, header="QGC WPL 120"))
    assert "line 1: expected the header" in old and "save it anew with Mission Planner" in old
    assert "is XML (KML, GPX?)" in refusal(wpl(tmp_path, HOME, header="<kml>"))
    assert refusal(wpl(tmp_path, HOME, header='{"fileType": "Plan",')).endswith("QGroundControl; end its name in .plan")
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe")
    assert "not UTF-8" in refusal(tmp_path / "a.txt")
    (tmp_path / "a.kml").write_text("")
    assert "suffix '.kml'" in refusal(tmp_path / "a.kml")
    assert "no such file" in refusal(tmp_path / "gone.plan")
    assert "not a file" in refusal(tmp_path)


def test_too_many_items_are_refused(tmp_path: Path) -> None:
    assert "more than 100000" in refusal(wpl(tmp_path, HOME, *("1 0" for _ in range(100_000))))


def guided(index: int, p1: float = 1, lat: float = 53.3) -> str:
    return do(index, 92, p1, lat=lat, lon=23.3)


def test_a_mission_that_hands_legs_over_is_the_autopilots_own(tmp_path: Path) -> None:
    """Its other commands are the autopilot's; the ground where the autopilot drives belongs to the grid."""
    items = (
        HOME,
        waypoint(1),
        do(2, 222, 60),
        guided(3),
        do(4, 181),
        do(5, 21, lat=53.4, lon=23.4),
        guided(6, lat=53.35),
    )
    mission = load_mission(wpl(tmp_path, *items))
    assert mission.in_auto and names(mission) == ["guided item 3", "guided item 6"]
    assert [target.place for target in mission.targets] == [GeoPoint(53.3, 23.3), GeoPoint(53.35, 23.3)]
    (ground,) = mission.weighted
    assert ground.weight == 0.5 and set(ground.area.places) == {GeoPoint(53.2, 23.2), GeoPoint(53.4, 23.4)}
    assert any("in AUTO" in note for note in mission.notes)


def test_a_leg_that_is_jumped_back_to_is_handed_over_again(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, guided(1), waypoint(2), do(3, 177, 1, 1)))
    assert names(mission) == ["guided item 1", "guided item 1 pass 2"]


def test_a_leg_without_a_place_is_refused(tmp_path: Path) -> None:
    assert "item 1: NAV_GUIDED_ENABLE (92): has no place" in refusal(wpl(tmp_path, HOME, do(1, 92, 1)))


def test_guided_that_is_switched_off_alone_begins_nothing(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), guided(2, p1=0)))
    assert names(mission) == ["waypoint 1"] and not mission.in_auto
    assert mission.notes == ("item 2: NAV_GUIDED_ENABLE (92): begins nothing with p1 0, so it is not used",)
