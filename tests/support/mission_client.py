"""The mission side of a ground station for tests: items by metres from home, files, upload and download."""

from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.world import geodesy
from tests.support.sitl_client import HOME, Client, ready

MISSION, FENCE, RALLY = 0, 1, 2
ORIGIN = (round(HOME.lat_deg * 1e7), round(HOME.lon_deg * 1e7))
Row = tuple[int, int, tuple[float, ...], int, int, float]
"""Command, frame, four parameters, latitude and longitude in 1e-7 degree, height."""

WPL_FIELDS = 12


def at(command: int, north_m: float = 0.0, east_m: float = 0.0, params: tuple[float, ...] = (), frame: int = 3) -> Row:
    """An item at a place so many metres from home."""
    lat, lon = geodesy.moved(ORIGIN, north_m, east_m)
    return command, frame, (*params, 0.0, 0.0, 0.0, 0.0)[:4], lat, lon, 0.0


def do(command: int, *params: float) -> Row:
    """An item without a place."""
    return command, 0, (*params, 0.0, 0.0, 0.0, 0.0)[:4], 0, 0, 0.0


def home() -> Row:
    return at(16, frame=0)


def item(seq: int, row: Row, kind: int = MISSION) -> Any:
    command, frame, params, lat, lon, z = row
    return mavlink.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, *params, lat, lon, z, kind)


def rows_of_file(path: Path) -> list[Row]:
    """A QGC WPL file, read by its own rule."""
    rows = []
    for line in path.read_text().splitlines():
        fields = line.split()
        if len(fields) == WPL_FIELDS:
            numbers = [float(field) for field in fields]
            place = (round(numbers[8] * 1e7), round(numbers[9] * 1e7))
            rows.append((int(numbers[3]), int(numbers[2]), tuple(numbers[4:8]), *place, numbers[10]))
    return rows


def heard(client: Client, kind: str, seconds: float = 0.06) -> list[Any]:
    return [m for m in client.run_for(seconds) if m.get_type() == kind]


def upload(client: Client, rows: list[Row], kind: int = MISSION) -> int:
    """Offer the items, send what is asked for, until there is an acknowledgement; gives its result."""
    client.send(mavlink.MAVLink_mission_count_message(1, 1, len(rows), kind))
    for _ in range(len(rows) + 2):
        for message in client.run_for(0.06):
            if message.get_type() == "MISSION_REQUEST" and message.mission_type == kind:
                client.send(item(message.seq, rows[message.seq], kind))
            elif message.get_type() == "MISSION_ACK" and message.mission_type == kind:
                return int(message.type)
    raise AssertionError("no MISSION_ACK")


def download(client: Client, kind: int = MISSION) -> list[Row]:
    """Every item that is stored."""
    client.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
    count = heard(client, "MISSION_COUNT")[0].count
    rows = []
    for seq in range(count):
        client.send(mavlink.MAVLink_mission_request_int_message(1, 1, seq, kind))
        (m,) = heard(client, "MISSION_ITEM_INT")
        assert (m.seq, m.mission_type, m.target_component) == (seq, kind, client.packer.srcComponent)
        rows.append((m.command, m.frame, (m.param1, m.param2, m.param3, m.param4), m.x, m.y, m.z))
    return rows


def in_auto(simulator: Any, rows: list[Row], **identity: int) -> Client:
    """An armed rover that has just been put into AUTO with this mission (home is added)."""
    client = ready(simulator, **identity)
    assert upload(client, [home(), *rows]) == 0
    client.received.clear()
    assert client.set_mode(10) == 0
    return client


def run_until(client: Client, text: str, limit_s: float = 200.0) -> None:
    """Run until something is said."""
    stop_s = client.simulator.time_s + limit_s
    while text not in client.texts():
        assert client.simulator.time_s < stop_s, client.texts()
        client.run_for(0.1)


def place_m(client: Client) -> tuple[float, float]:
    truth = client.simulator.truth
    return truth.north_m, truth.east_m
