"""The mission stored in the autopilot: it means the same as a file with its items."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from companion.mission.items import Item
from companion.mission.load import load_mission
from companion.mission.mission import HomePoint, MissionError
from companion.mission.stored_mission import digest, mission_of
from tests.companion.mission.test_waypoints_reader import do, waypoint, wpl

HOME = Item(0, 16, 0, (0.0, 0.0, 0.0, 0.0), 53.1, 23.1)


def item(index: int, command: int, *params: float, lat: float = 0.0, lon: float = 0.0, frame: int = 3) -> Item:
    filled = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return Item(index, command, frame, (filled[0], filled[1], filled[2], filled[3]), lat, lon)


GOING = [
    HOME,
    item(1, 16, 5.0, lat=53.2, lon=23.2),
    item(2, 178, 0.0, 1.5),
    item(3, 19, 7.0, lat=53.21, lon=23.2),
    item(4, 93, 2.0),
    item(5, 20),
]


def test_items_mean_what_they_mean_in_a_file(tmp_path: Path) -> None:
    mission = mission_of(GOING)
    names = ["waypoint 1", "waypoint 3", "home"]
    assert [target.name for target in mission.targets] == names
    assert [(target.hold_s, target.speed_m_s) for target in mission.targets] == [(5.0, None), (9.0, 1.5), (0.0, 1.5)]
    assert mission.targets[2].place == HomePoint(0.0, 0.0)
    rows = (
        "0 1 0 16 0 0 0 0 53.1 23.1 0 1",
        waypoint(1, hold=5),
        do(2, 178, 0, 1.5),
        do(3, 19, 7, lat=53.21, lon=23.2),
    )
    file = load_mission(wpl(tmp_path, *rows, do(4, 93, 2), do(5, 20)))
    assert (file.targets, file.planned_home) == (mission.targets, mission.planned_home)


@pytest.mark.parametrize("items", [[], [HOME]])
def test_no_mission_is_named(items: list[Item]) -> None:
    with pytest.raises(MissionError, match=r"^the autopilot's mission: there is none; upload one"):
        mission_of(items)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (item(1, 21, lat=53.2, lon=23.2), r"item 1: NAV_LAND \(21\): no rover can do it; --skip-unknown"),
        (item(1, 16, lat=53.2, lon=23.2, frame=1), "item 1: NAV_WAYPOINT .*frame 1"),
        (item(1, 16, math.nan, lat=math.nan, lon=23.2), "item 1: NAV_WAYPOINT .*missing"),
        (item(1, 42702), "item 1: NAV_SCRIPT_TIME .*only the autopilot itself"),
    ],
)
def test_an_item_that_cannot_be_driven_is_named_by_its_number(wrong: Item, text: str) -> None:
    with pytest.raises(MissionError, match=f"^the autopilot's mission: {text}") as caught:
        mission_of([HOME, wrong])
    assert "\n" not in str(caught.value)


def test_a_mission_without_a_place_is_refused() -> None:
    with pytest.raises(MissionError, match=r"^the autopilot's mission: .*at least one place"):
        mission_of([HOME, item(1, 178, 0.0, 1.0)])


def test_the_digest_knows_items_and_not_home() -> None:
    moved = Item(0, 16, 0, (0.0, 0.0, 0.0, 0.0), 53.15, 23.1)
    assert digest([moved, *GOING[1:]]) == digest(GOING)
    assert digest([HOME, item(1, 16, 6.0, lat=53.2, lon=23.2), *GOING[2:]]) != digest(GOING)
