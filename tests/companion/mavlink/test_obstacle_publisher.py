"""A lidar as OBSTACLE_DISTANCE: read back by the companion's own decoder, and over UDP by way of the simulator."""

from __future__ import annotations

import math
import signal
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.scan import RangeScan
from companion.mavlink.obstacle_publisher import CELLS, UNKNOWN_CM, ObstaclePublisher, cells_cm
from companion.mavlink.ranges import obstacle_distance
from tests.sitl.network.test_server import free_port
from tests.support.lidars import desk, spinning, to_walls_m
from tests.support.mavlink_vehicle import Station
from tests.support.rig import yard
from tests.support.served import PATIENCE_S, Served, process, wait_until


def parsed_one(raw: bytes) -> Any:
    return (mavlink.MAVLink(None).parse_buffer(raw) or [None])[0]


def scan(bearing_deg: list[float], range_m: list[float], empty_m: float = math.inf) -> RangeScan:
    return RangeScan(2.0, np.radians(bearing_deg), np.array(range_m), 0.2, 8.0, 0.01, "x", 0, empty_m=empty_m)


def test_the_nearest_reading_of_each_cell_counts() -> None:
    cells = cells_cm(scan([0.0, 2.0, -2.4, 5.0, 90.0, 180.0], [3.0, 1.5, math.inf, math.nan, math.inf, 0.05]))
    assert cells[0] == 150 and cells[1] == UNKNOWN_CM and cells[18] == 801
    assert cells[36] == 20, "nearer than the minimum is told as the minimum"
    assert cells[2:18] == [UNKNOWN_CM] * 16


def test_nothing_seen_is_told_no_farther_than_it_is_known() -> None:
    message = parsed_one(ObstaclePublisher().scan(scan([0.0, 5.0], [math.inf, 6.0], empty_m=5.0)))
    assert message.max_distance == 500 and message.distances[:2] == [501, 501]


def test_the_companion_reads_the_same_walls_back() -> None:
    one = desk("LD19").run(0.5)[-1]
    message = parsed_one(ObstaclePublisher().scan(one))
    assert (message.frame, message.increment_f, message.angle_offset) == (mavlink.MAV_FRAME_BODY_FRD, 5.0, 0.0)
    assert (message.min_distance, message.max_distance, len(message.distances)) == (2, 500, CELLS)
    back = obstacle_distance(message, 1.0)
    assert back is not None and len(back.range_m) == CELLS
    hit = np.isfinite(back.range_m)
    assert hit.mean() > 0.7
    near_m = np.minimum(*(to_walls_m(back.bearing_rad[hit] + aside) for aside in (-0.045, 0.045)))
    assert np.abs(back.range_m[hit] - near_m).max() < 0.1


def test_it_takes_over_the_systems_id_of_the_rover_and_beats_once_a_second() -> None:
    publisher = ObstaclePublisher(component_id=197)
    assert parsed_one(publisher.heartbeat(0.0)).get_srcSystem() == 1
    publisher.hear(Station(7).heartbeat())
    assert publisher.system_id == 7
    assert publisher.heartbeat(0.5) == b""
    beat = parsed_one(publisher.heartbeat(1.0))
    assert (beat.get_srcSystem(), beat.get_srcComponent(), beat.autopilot) == (7, 197, mavlink.MAV_AUTOPILOT_INVALID)


@pytest.mark.slow
def test_the_command_publishes_over_udp_to_an_autopilot_which_passes_it_on(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    port = free_port(socket.SOCK_DGRAM)
    world = Served(mission, f"udpin:127.0.0.1:{port}")
    link, told = f"udpout:127.0.0.1:{port}", []
    try:
        with (
            spinning(tmp_path / "tty"),
            process("companion", "lidar", f"LD19:{tmp_path / 'tty'}", "--connect", link, "--component", 197) as child,
        ):
            world.pilot(mavlink.MAV_CMD_REQUEST_MESSAGE, 0.0)  # the autopilot passes packets on to whom it has heard
            wait_until(lambda: told.extend(of_lidar(world)) or len(told) >= 5)
            child.send_signal(signal.SIGTERM)
            assert child.wait(timeout=PATIENCE_S) == 0
            said = child.stdout.read()
    finally:
        world.close()
    assert said.startswith("publishing lidar 1 (LD19) on udpout:") and f"{link}: heard\n" in said, said
    last = obstacle_distance(told[-1], 0.0)
    assert last is not None
    assert abs(float(last.range_m[0]) - 4.0) < 0.1 and told[-1].get_srcSystem() == 1


def of_lidar(world: Served) -> list[Any]:
    """Its scans, as a ground station at the autopilot hears them."""
    return [m for m in world.heard() if m.get_type() == "OBSTACLE_DISTANCE" and m.get_srcComponent() == 197]
