"""Missions as ArduRover 4.7 took them in the recording, and real mission files of other projects."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import GeoPoint
from sitl.simulator import Simulator
from sitl.world import geodesy
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.conformance.recordings import RECORDINGS
from tests.conformance.recordings import replay as replayed
from tests.support.mission_client import FENCE, MISSION, RALLY, Row, download, place_m, rows_of_file, run_until, upload
from tests.support.shared_data import SHARED, needs_shared
from tests.support.sitl_client import Client, open_ground, ready

FILES = SHARED / "data" / "missions"
PLACED = {16, 17, 18, 19, 22}
MISSIONS = [
    "ardupilot/ArduRover_Tests__ArmFeatures__test_arming.txt",
    "ardupilot/ArduRover_Tests__DriveMission__rover1.txt",
    "ardupilot/ArduRover_Tests__DriveRTL__rtl.txt",
    "ardupilot/ArduRover_Tests__GripperMission__rover-gripper-mission.txt",
    "mavsdk/mission_planner_sample.txt",
    "qgroundcontrol/MissionPlanner.waypoints",
    "ros_gz_rover/playpen.txt",
]
FENCES = [
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRuler__rover-path-bendyruler-fence.txt",
    "pymavlink/fence-110.txt",
]


@pytest.fixture(scope="module")
def replay() -> tuple[list[Any], list[Any]]:
    """What the vehicle said in the recording, and what the simulator said to the same."""
    one = replayed(RECORDINGS[1])
    return [heard.message for heard in one.real], [heard.message for heard in one.ours]


def of(messages: list[Any], *kinds: str) -> list[Any]:
    return [m for m in messages if m.get_type() in kinds]


@needs_shared
def test_the_transfer_goes_as_recorded(replay: tuple[list[Any], list[Any]]) -> None:
    kinds = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT")

    def told(messages: list[Any]) -> list[dict[str, Any]]:
        return [m.to_dict() for m in of(messages, *kinds)]

    real, ours = told(replay[0]), told(replay[1])
    # The height of home is of the place where it was recorded.
    for one in (*real, *ours):
        if one["mavpackettype"] == "MISSION_ITEM_INT" and one["seq"] == 0:
            one.pop("z")
    assert len(real) == 12
    assert ours == real


@needs_shared
def test_totals_states_and_texts_are_as_recorded(replay: tuple[list[Any], list[Any]]) -> None:
    def totals(messages: list[Any]) -> list[tuple[float, int, int]]:
        found = [m for m in of(messages, "PARAM_VALUE") if m.param_id == "MIS_TOTAL"]
        return [(m.param_value, m.param_type, m.param_index) for m in found][-3:]

    def states(messages: list[Any]) -> set[tuple[int, int, int, int]]:
        return {(m.seq, m.total, m.mission_state, m.mission_mode) for m in of(messages, "MISSION_CURRENT")}

    def texts(messages: list[Any]) -> list[str]:
        return [m.text for m in of(messages, "STATUSTEXT") if "plan" in m.text or "ission" in m.text]

    for look in (totals, states, texts):
        assert look(replay[1]) == look(replay[0])
    assert totals(replay[0])[-1] == (4.0, 4, 65535)


@needs_shared
def test_the_place_driven_to_is_told_in_the_same_modes(replay: tuple[list[Any], list[Any]]) -> None:
    def places(messages: list[Any]) -> set[tuple[int, int, int, int]]:
        found = [m for m in of(messages, "POSITION_TARGET_GLOBAL_INT") if m.time_boot_ms > 70_000]
        return {(m.lat_int, m.lon_int, m.type_mask, m.coordinate_frame) for m in found}

    assert places(replay[1]) == places(replay[0])


def kept(row: Row) -> Row:
    """What comes back of an item: places only where the command has one, frames by their kind."""
    command, frame, params, lat, lon, z = row
    if command not in PLACED:
        return command, 0, params, 0, 0, 0.0
    return command, {5: 0}.get(frame, frame), params, lat, lon, pytest.approx(z, abs=0.011)


@needs_shared
@pytest.mark.parametrize("name", MISSIONS)
def test_real_missions_come_back_unchanged(name: str) -> None:
    rows = rows_of_file(FILES / name)
    client = Client(open_ground())
    client.run_to(20.0)
    assert upload(client, rows) == 0
    assert download(client)[1:] == [kept(row) for row in rows[1:]]


@needs_shared
@pytest.mark.parametrize("name", FENCES)
def test_real_fences_come_back_unchanged(name: str) -> None:
    rows = rows_of_file(FILES / name)
    assert len(rows) == 10
    client = Client(open_ground())
    client.run_to(20.0)
    assert upload(client, rows, FENCE) == 0
    assert download(client, FENCE) == rows


@needs_shared
def test_real_rally_points_come_back_with_their_places() -> None:
    rows = rows_of_file(FILES / "pymavlink" / "rally-110.txt")
    client = Client(open_ground())
    client.run_to(20.0)
    assert upload(client, rows, RALLY) == 0
    assert [(row[0], row[3], row[4]) for row in download(client, RALLY)] == [(row[0], row[3], row[4]) for row in rows]


def at_home_of(rows: list[Row]) -> tuple[Client, list[tuple[float, float]]]:
    """A rover armed at the mission's home, and where its places are from there, metres."""
    home = (rows[0][3], rows[0][4])
    start = SimStart(0.0, 0.0, 0.0, GeoPoint(home[0] * 1e-7, home[1] * 1e-7))
    client = ready(Simulator(World.open(), start, sensors="none", noise=False))
    assert upload(client, rows, MISSION) == 0
    client.received.clear()
    return client, [geodesy.offset_m(home, (row[3], row[4])) for row in rows]


@needs_shared
@pytest.mark.parametrize("name", [*MISSIONS[1:4], MISSIONS[5]])
def test_real_missions_are_driven(name: str) -> None:
    rows = rows_of_file(FILES / name)
    client, places = at_home_of(rows)
    assert client.set_mode(10) == 0
    track = []
    while "Mission Complete" not in client.texts():
        client.run_for(0.5)
        track.append(place_m(client))
        assert len(track) < 4000
    for row, place in zip(rows[1:], places[1:], strict=True):
        if row[0] == 16:
            assert min(math.dist(place, here) for here in track) < 3.0
    assert [m.seq for m in client.of("MISSION_ITEM_REACHED")][-1] >= len(rows) - 2


@needs_shared
def test_a_mission_without_end_goes_round() -> None:
    client, places = at_home_of(rows_of_file(FILES / MISSIONS[6]))
    assert client.set_mode(10) == 0
    run_until(client, "Reached waypoint #7", 120.0)
    client.received.clear()
    run_until(client, "Reached waypoint #7", 120.0)
    assert math.dist(place_m(client), places[7]) < 3.2


@needs_shared
def test_a_real_plan_is_driven() -> None:
    """QGroundControl's own plan for a rover: waypoints in two frames, a speed, a jump or two."""
    path = next((FILES / "qgroundcontrol_rover_plans").glob("*.plan"))
    plan = json.loads(Path(path).read_text())["mission"]
    home = plan["plannedHomePosition"]
    rows: list[Row] = [(16, 0, (0.0,) * 4, round(home[0] * 1e7), round(home[1] * 1e7), home[2])]
    for one in plan["items"]:
        values = [math.nan if value is None else float(value) for value in one["params"]]
        rows.append(
            (one["command"], one["frame"], tuple(values[:4]), round(values[4] * 1e7), round(values[5] * 1e7), values[6])
        )
    client, places = at_home_of(rows)
    assert client.set_mode(10) == 0
    first = next(place for row, place in zip(rows[1:], places[1:], strict=True) if row[0] == 16)
    while "Reached waypoint #1" not in client.texts():
        assert client.simulator.time_s < math.hypot(*first) / 2.5 + 120.0
        client.run_for(5.0)
    assert math.dist(place_m(client), first) < 20.0
