"""QGroundControl's plans: every value is understood or refused with its place."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import GeoPoint
from companion.mission.ground_station_reader import load_ground_station_file
from companion.mission.load import load_mission
from companion.mission.mission import Area
from tests.companion.mission.test_waypoints_reader import names, refusal


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
        ("version", 2, "version: only version 1 is understood, got 2; save it with a newer QGroundControl"),
        ("version", None, "version: only version 1 is understood, there is none"),
        ("mission", None, "mission: expected an object"),
        ("mission.version", 1, "mission.version"),
        ("mission.items", {}, "mission.items: expected a list"),
        ("mission.items.0", 5, "mission.items 1: not an item"),
        ("mission.items.0.type", "Odd", "type 'Odd'"),
        ("mission.items.0.command", 22, "item 1: NAV_TAKEOFF (22)"),
        (
            "mission.items.0.command",
            "16",
            "got '16'; write 16 without quotes",
        ),
        ("mission.items.0.doJumpId", 2, "two items"),
        ("mission.items.0.params", [1, 2], "7 values"),
        ("mission.items.0.params.0", "3", "params 1"),
        ("mission.items.0.params.0", 10**400, "params 1"),
        ("mission.items.0.params.4", None, "item 1: NAV_WAYPOINT (16): latitude and longitude are missing"),
        ("mission.items.2.TransectStyleComplexItem", None, "ComplexItem 'survey': is not understood"),
        ("mission.items.2.TransectStyleComplexItem.Items.0.command", 21, "item 3: NAV_LAND (21): no rover can do it"),
        ("mission.items.2.TransectStyleComplexItem.Items.0.type", "ComplexItem", "is not understood"),
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


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("QGC WPL 110\n0\t1\t0\t16", "line 1: begins with 'QGC WPL 110'; end its name in .waypoints"),
        (
            '{"fileType": "Plan",\n"mission": {"items": [{}',
            "line 2: not valid JSON: the end is missing; the file seems cut",
        ),
        ('{"fileType": "Plan",\n"mis', "the file seems cut"),
        ('{"fileType": "Plan",\n"version": tr', "the file seems cut"),
        ('{"fileType": "Plan",\n"version": 1,}', "line 2: not valid JSON: expecting property name"),
        ("\n", "the file is empty"),
    ],
)
def test_another_file_and_a_cut_one_are_told(tmp_path: Path, text: str, reason: str) -> None:
    assert reason in refusal(plan(tmp_path, text))


def test_fences_alone_can_be_taken_but_not_driven(tmp_path: Path) -> None:
    data = changed("mission.items", [])
    assert "fences but no place" in refusal(plan(tmp_path, data))
    assert len(load_ground_station_file(plan(tmp_path, data)).keep_out) == 1
