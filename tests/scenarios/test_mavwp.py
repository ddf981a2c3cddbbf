"""pymavlink's own clients, mavutil and mavwp, against ``rover-sitl serve`` on TCP: real files up, down and compared."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil, mavwp

from tests.sitl.network.test_server import free_port
from tests.support.served import process
from tests.support.shared_data import SHARED, needs_shared

FILES = SHARED / "data" / "missions"
OPEN = Path(__file__).parents[2] / "missions" / "open.toml"
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def link() -> Iterator[Any]:
    """A mavutil connection to a simulator in a process of its own, ten times as fast as real time."""
    port = free_port()
    with process("sitl", "serve", OPEN, "--listen", f"tcp:127.0.0.1:{port}", "--speedup", 10) as child:
        assert "listening" in child.stdout.readline()
        connection = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=255)
        assert connection.wait_heartbeat(timeout=PATIENCE_S) is not None
        assert connection.recv_match(type="HOME_POSITION", blocking=True, timeout=PATIENCE_S) is not None
        yield connection
        connection.close()


def send(link: Any, loader: Any, kind: int) -> int:
    """Upload a loader's items; gives the result of the acknowledgement."""
    link.mav.mission_count_send(1, 1, loader.count(), kind)
    for _ in range(loader.count() + 1):
        asked = link.recv_match(
            type=["MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"], blocking=True, timeout=PATIENCE_S
        )
        assert asked is not None and asked.mission_type == kind
        if asked.get_type() == "MISSION_ACK":
            return int(asked.type)
        one = loader.wp(asked.seq)
        one.mission_type = kind
        link.mav.send(one)
    raise AssertionError("no MISSION_ACK")


def fetch(link: Any, kind: int) -> list[Any]:
    """Download everything with MISSION_REQUEST_INT."""
    link.mav.mission_request_list_send(1, 1, kind)
    count = link.recv_match(type="MISSION_COUNT", blocking=True, timeout=PATIENCE_S).count
    items = []
    for seq in range(count):
        link.mav.mission_request_int_send(1, 1, seq, kind)
        items.append(link.recv_match(type="MISSION_ITEM_INT", blocking=True, timeout=PATIENCE_S))
    link.mav.mission_ack_send(1, 1, 0, kind)
    return items


def degrees(one: Any) -> tuple[float, float]:
    scale = 1e-7 if one.get_type() == "MISSION_ITEM_INT" else 1.0
    return one.x * scale, one.y * scale


@needs_shared
@pytest.mark.parametrize(
    ("loader", "name", "kind"),
    [
        (mavwp.MAVWPLoader, "ardupilot/ArduRover_Tests__DriveMission__rover1.txt", 0),
        (mavwp.MissionItemProtocol_Fence, "pymavlink/fence-110.txt", 1),
        (mavwp.MissionItemProtocol_Rally, "pymavlink/rally-110.txt", 2),
    ],
)
def test_files_go_up_and_come_back(link: Any, loader: Any, name: str, kind: int) -> None:
    loaded = loader(target_system=1, target_component=1)
    loaded.load(str(FILES / name))
    assert send(link, loaded, kind) == 0
    back = fetch(link, kind)
    assert [one.command for one in back] == [loaded.wp(seq).command for seq in range(loaded.count())]
    for seq in range(1 if kind == 0 else 0, loaded.count()):
        sent = loaded.wp(seq)
        if (sent.x, sent.y) != (0, 0):
            # mavwp may send places in single precision: four millionths of a degree.
            assert degrees(back[seq]) == pytest.approx(degrees(sent), abs=1e-5)
        if kind < 2:
            assert back[seq].param1 == sent.param1
    link.mav.mission_clear_all_send(1, 1, kind)
    assert link.recv_match(type="MISSION_ACK", blocking=True, timeout=PATIENCE_S).type == 0
    assert fetch(link, kind) == []


@needs_shared
def test_rally_points_of_mavproxys_own_form(link: Any) -> None:
    loaded = mavwp.MAVRallyLoader(1, 1)
    loaded.load(str(FILES / "ardupilot" / "ArduRover_Tests__Rally__rover-test-rally.txt"))
    assert loaded.rally_count() == 2
    link.mav.mission_count_send(1, 1, 2, 2)
    for number in range(2):
        assert link.recv_match(type="MISSION_REQUEST", blocking=True, timeout=PATIENCE_S).seq == number
        point = loaded.rally_points[number]
        link.mav.mission_item_int_send(1, 1, number, 3, 5100, 0, 1, 0, 0, 0, 0, point.lat, point.lng, point.alt, 2)
    assert link.recv_match(type="MISSION_ACK", blocking=True, timeout=PATIENCE_S).type == 0
    assert [(one.x, one.y, one.z) for one in fetch(link, 2)] == [
        (point.lat, point.lng, point.alt) for point in loaded.rally_points
    ]


def test_mavutil_reads_and_sets_the_current_item(link: Any) -> None:
    loaded = mavwp.MAVWPLoader(1, 1)
    for _ in range(3):
        loaded.add_latlonalt(-35.3632, 149.1653, 0.0)
    assert send(link, loaded, 0) == 0
    link.waypoint_set_current_send(2)
    while True:
        current = link.recv_match(type="MISSION_CURRENT", blocking=True, timeout=PATIENCE_S)
        assert current is not None
        if current.seq == 2:
            break
    assert current.total == 2
