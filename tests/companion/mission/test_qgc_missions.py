"""WPL and plan files: every item is understood or refused by its name."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import GeoPoint
from companion.mission.load import load_mission
from companion.mission.mission import Area, HomePoint, Mission, MissionError
from companion.mission.qgc import load_qgc
from tests.support.shared_data import SHARED, needs_shared

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
    ]
    assert mission.targets[-1].place == HomePoint(0.0, 0.0)
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


def test_a_jump_counts_once_for_the_whole_mission(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), do(2, 177, 1, 1), do(3, 177, 1, 1)))
    assert len(mission.targets) == 3


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
        ([HOME, do(1, 18, 1, lat=1, lon=1)], "NAV_LOITER_TURNS (18)"),
        ([HOME, waypoint(1), do(2, 31999)], "item 2: command 31999"),
        ([HOME, waypoint(1), do(2, 177, 1, -1)], "for ever"),
        ([HOME, waypoint(1), do(2, 177, 7, 1)], "no item 7"),
        ([HOME, waypoint(1), do(2, 177, 0, 1)], "no item 0"),
        ([HOME, waypoint(1), do(2, 177, 2, 1)], "no item 2"),
        ([HOME, waypoint(1), do(2, 177, 1, 1.5)], "1.5 repeats"),
        ([HOME, waypoint(1), do(2, 177, 1, 1e9)], "longer than"),
        ([HOME, do(1, 178, 1, 1), do(2, 177, 1, 1e9)], "longer than"),
        ([HOME, do(1, 178, 1, 0), waypoint(2)], "speed of 0"),
        ([HOME, do(1, 178, 2, 3), waypoint(2)], "kind 2"),
        ([HOME, waypoint(1, hold=-1)], "hold of -1"),
        ([HOME, waypoint(1, lat=91)], "91.0, 23.2 is not a latitude"),
        ([HOME, waypoint(1, lat=0, lon=0)], "has no place"),
        ([HOME, "1 0 1 16 0 0 0 0 5 5 0 1"], "frame 1 (LOCAL_NED)"),
        ([HOME, do(1, 93, 5), waypoint(2)], "delay before"),
        ([HOME, waypoint(1), do(2, 93, -1)], "time of day"),
        ([HOME, do(1, 17, lat=1, lon=1), waypoint(2)], "item 2: NAV_WAYPOINT (16): can never begin"),
        ([HOME, waypoint(1), do(2, 5002, 3, lat=1, lon=1)], "1 of its 3 corners"),
        ([HOME, waypoint(1), do(2, 5002, 2, lat=1, lon=1)], "polygon of 2 corners"),
        ([HOME, waypoint(1), do(2, 5004, 0, lat=1, lon=1)], "radius of 0"),
        ([HOME, waypoint(2)], "line 3: item 1 is expected"),
        ([HOME, "1 0 3 16 0 0 0 0 5 5 0"], "line 3: 12 values"),
        ([HOME, "1 0 3 16 0 0 0 0 5,5 5 0 1"], "line 3: latitude"),
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
    assert "line 1: expected the header" in refusal(wpl(tmp_path, HOME, header="QGC WPL 120"))
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe")
    assert "not UTF-8" in refusal(tmp_path / "a.txt")
    (tmp_path / "a.kml").write_text("")
    assert "suffix '.kml'" in refusal(tmp_path / "a.kml")
    assert "no such file" in refusal(tmp_path / "gone.plan")
    assert "not a file" in refusal(tmp_path)


def test_too_many_items_are_refused(tmp_path: Path) -> None:
    assert "more than 100000" in refusal(wpl(tmp_path, HOME, *("1 0" for _ in range(100_000))))


# --- plan ------------------------------------------------------------------------------------------------------------


def simple(number: int, command: int, *params: float | None, frame: int = 3) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "command": command,
        "doJumpId": number,
        "frame": frame,
        "params": list(params),
        "autoContinue": True,
    }


PLAN: dict[str, Any] = {
    "fileType": "Plan",
    "version": 1,
    "groundStation": "QGroundControl",
    "geoFence": {
        "version": 2,
        "polygons": [{"version": 1, "inclusion": False, "polygon": [[53.0, 23.0], [53.0, 23.1], [53.1, 23.1]]}],
        "circles": [{"version": 1, "inclusion": True, "circle": {"center": [53.0, 23.0], "radius": 900}}],
    },
    "rallyPoints": {"version": 2, "points": [[53.0, 23.0, 0]]},
    "mission": {
        "version": 2,
        "plannedHomePosition": [53.05, 23.05, 100],
        "items": [
            simple(1, 16, 3, 0, 0, None, 53.2, 23.2, 0),
            simple(2, 178, 1, 1.5, -1, 0, 0, 0, 0, frame=2),
            {
                "type": "ComplexItem",
                "complexItemType": "survey",
                "TransectStyleComplexItem": {"Items": [simple(3, 16, 0, 0, 0, None, 53.3, 23.3, 0)]},
            },
            simple(4, 177, 1, 1, 0, 0, 0, 0, 0, frame=2),
            simple(5, 20, 0, 0, 0, 0, 0, 0, 0, frame=2),
        ],
    },
}


def plan(folder: Path, data: object) -> Path:
    path = folder / "m.plan"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def test_a_whole_plan(tmp_path: Path) -> None:
    mission = load_mission(plan(tmp_path, PLAN))
    assert names(mission) == ["waypoint 1", "waypoint 3", "waypoint 1 pass 2", "waypoint 3 pass 2", "home"]
    assert [target.speed_m_s for target in mission.targets] == [None, 1.5, 1.5, 1.5, 1.5]
    assert mission.planned_home == GeoPoint(53.05, 23.05)
    assert len(mission.keep_out) == 1 and len(mission.keep_out[0].places) == 3
    assert mission.keep_in == (Area((GeoPoint(53.0, 23.0),), radius_m=900.0),)
    assert any("1 rally points" in note for note in mission.notes)


def changed(place: str, value: object) -> dict[str, Any]:
    data = copy.deepcopy(PLAN)
    *path, last = (int(part) if part.isdigit() else part for part in place.split("."))
    inner: Any = data
    for part in path:
        inner = inner[part]
    inner[last] = value
    return data


@pytest.mark.parametrize(
    ("place", "value", "reason"),
    [
        ("fileType", "Mission", "fileType"),
        ("version", 2, "version: only version 1"),
        ("mission", None, "mission: expected an object"),
        ("mission.version", 1, "mission.version"),
        ("mission.items", {}, "mission.items: expected a list"),
        ("mission.items.0", 5, "mission.items 1: not an item"),
        ("mission.items.0.type", "Odd", "type 'Odd'"),
        ("mission.items.0.command", 22, "item 1: NAV_TAKEOFF (22)"),
        ("mission.items.0.command", "16", "mission.items 1: command"),
        ("mission.items.0.doJumpId", 2, "two items"),
        ("mission.items.0.params", [1, 2], "7 values"),
        ("mission.items.0.params.0", "3", "params 1"),
        ("mission.items.0.params.0", 10**400, "params 1"),
        ("mission.items.0.params.4", None, "item 1: NAV_WAYPOINT (16): latitude and longitude are missing"),
        ("mission.items.2.TransectStyleComplexItem", None, "ComplexItem 'survey' is not understood"),
        ("mission.items.2.TransectStyleComplexItem.Items.0.command", 206, "DO_SET_CAM_TRIGG_DIST (206)"),
        ("mission.items.2.TransectStyleComplexItem.Items.0.type", "ComplexItem", "is not understood"),
        ("mission.items.3.params.1", -1, "for ever"),
        ("mission.plannedHomePosition", [100, 0, 0], "mission.plannedHomePosition"),
        ("mission.plannedHomePosition", "x", "mission.plannedHomePosition"),
        ("geoFence.version", 1, "geoFence.version"),
        ("geoFence.polygons.0.inclusion", "no", "geoFence.polygons 1: inclusion"),
        ("geoFence.polygons.0.polygon", [[53.0, 23.0], [53.0, 23.1]], "at least three corners"),
        ("geoFence.circles.0.circle.radius", -1, "radius of -1"),
        ("geoFence.circles.0.circle", 5, "geoFence.circles 1.circle"),
        ("rallyPoints.points", 7, "rallyPoints.points"),
    ],
)
def test_bad_plans_get_one_line(tmp_path: Path, place: str, value: object, reason: str) -> None:
    assert reason in refusal(plan(tmp_path, changed(place, value)))


@pytest.mark.parametrize("text", ["", "[1]", "{", "[" * 100_000, '{"a": NaN}', "nul", "\ufeff{}"])
def test_text_that_is_no_plan(tmp_path: Path, text: str) -> None:
    assert refusal(plan(tmp_path, text))


def test_fences_alone_can_be_taken_but_not_driven(tmp_path: Path) -> None:
    data = changed("mission.items", [])
    assert "fences but no place" in refusal(plan(tmp_path, data))
    assert len(load_qgc(plan(tmp_path, data)).keep_out) == 1


# --- real files: how many targets, or why not ------------------------------------------------------------------------

FENCE = "fences but no place to go to"
REAL: dict[str, int | str] = {
    "ardupilot/ArduRover_Tests__AC_Avoidance__rover-fence-ac-avoid.txt": "expected the header",
    "ardupilot/ArduRover_Tests__ArmFeatures__test_arming.txt": 1,
    "ardupilot/ArduRover_Tests__DriveMission__rover1.txt": "item 19: NAV_LOITER_TURNS (18)",
    "ardupilot/ArduRover_Tests__DriveRTL__rtl.txt": 3,
    "ardupilot/ArduRover_Tests__GCSFailsafe__test_arming.txt": 1,
    "ardupilot/ArduRover_Tests__GripperMission__rover-gripper-mission.txt": "item 2: DO_GRIPPER (211)",
    "ardupilot/ArduRover_Tests__MAVProxy_SetModeUsingSwitch__test_arming.txt": 1,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRulerEasierAuto__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRulerEasierGuided__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRuler__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__Rally__rover-test-rally.txt": "expected the header",
    "mavsdk/mission_planner_sample.txt": "item 0: NAV_TAKEOFF (22)",
    "mavsdk/qgroundcontrol_sample.plan": "item 1: NAV_TAKEOFF (22)",
    "mavsdk/qgroundcontrol_sample_wrong_overall_version.plan": "only version 1 is understood, got 42",
    "pymavlink/fence-110.txt": FENCE,
    "pymavlink/rally-110.txt": "target: there is none",
    "qgroundcontrol/MissionPlanner.waypoints": 5,
    "qgroundcontrol_rover_plans/ArduPilotSITL-ArduRover.plan": 7,
    "ros_gz_rover/playpen.txt": "item 8: DO_JUMP (177): repeats for ever",
}


@needs_shared
def test_every_real_file_is_in_the_table() -> None:
    folder = SHARED / "data" / "missions"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*") if path.name != "SOURCE.txt"}
    assert files == set(REAL)


@needs_shared
@pytest.mark.parametrize(("name", "expected"), REAL.items())
def test_real_files(name: str, expected: int | str) -> None:
    path = SHARED / "data" / "missions" / name
    if isinstance(expected, str):
        assert expected in refusal(path)
    else:
        assert len(load_mission(path).targets) == expected


@needs_shared
def test_a_real_fence_file_has_its_areas() -> None:
    mission = load_qgc(SHARED / "data" / "missions" / "pymavlink" / "fence-110.txt")
    assert [len(area.places) for area in mission.keep_in] == [8]
    assert [area.radius_m for area in mission.keep_out] == [20.0, 20.0]


def guided(index: int, p1: float = 1, lat: float = 53.3) -> str:
    return do(index, 92, p1, lat=lat, lon=23.3)


def test_a_mission_that_hands_legs_over_is_the_autopilots_own(tmp_path: Path) -> None:
    """Its other commands are none of ours, whatever they are; the ground where the autopilot drives belongs to the grid."""
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


def test_guided_that_is_switched_off_alone_is_not_understood(tmp_path: Path) -> None:
    text = refusal(wpl(tmp_path, HOME, waypoint(1), guided(2, p1=0)))
    assert text.startswith("item 2: NAV_GUIDED_ENABLE (92): not understood")
