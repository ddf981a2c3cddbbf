"""The simulator on real sockets, its time driven by the test."""

import contextlib
import secrets
import socket
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from sitl.cli.commands import app
from sitl.network import Endpoint, ListenError, open_endpoint
from sitl.network.endpoint import datagrams
from sitl.network.event_log import EventLog
from sitl.network.server import serve
from sitl.sensors.lidar_bytes import MAKES
from sitl.sensors.serial_lidar import MountedLidar
from sitl.simulator import Simulator
from sitl.world.truth import Collision
from tests.support.sitl_client import open_ground


class Bench:
    """A simulator with endpoints; ``run`` serves for some simulated seconds, as fast as possible."""

    def __init__(self) -> None:
        self.simulator: Simulator = open_ground()
        self.endpoints: list[Endpoint] = []
        self.said: list[str] = []
        self.real_s = 0.0
        self.log = EventLog(self.said.append, lambda: self.real_s)

    def run(self, seconds: float) -> None:
        goal_s = self.simulator.time_s + seconds
        now_s = 0.0

        def clock() -> float:
            # Every look at the clock is 5 ms later: no waiting, and the same run every time.
            nonlocal now_s
            now_s += 0.005
            return now_s

        serve(self.simulator, self.endpoints, clock, 10.0, lambda: self.simulator.time_s < goal_s, self.log)

    def open(self, url: str) -> None:
        self.endpoints.append(open_endpoint(url, self.simulator, self.log))


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    for endpoint in made.endpoints:
        endpoint.close()


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """One that nobody gets by chance before it is used: the system gives those from 32768 on to who asks for any."""
    while True:
        port = 20_000 + secrets.randbelow(12_000)
        with socket.socket(socket.AF_INET, kind) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def read_all(connection: socket.socket) -> list[Any]:
    connection.settimeout(0.2)
    parser, found = mavlink.MAVLink(None), []
    try:
        while data := connection.recv(65536):
            found += parser.parse_buffer(data) or []
    except TimeoutError:
        pass
    return found


def request_version() -> bytes:
    packer = mavlink.MAVLink(None, 255, 190)
    return bytes(mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0).pack(packer))


def kinds(messages: list[Any]) -> set[str]:
    return {message.get_type() for message in messages}


def test_tcp_clients_come_and_go(bench: Bench) -> None:
    port = free_port()
    bench.open(f"tcp:127.0.0.1:{port}")
    bench.run(1.0)
    for _ in range(3):
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.sendall(request_version())
            bench.run(5.0)
            assert {"HEARTBEAT", "COMMAND_ACK", "AUTOPILOT_VERSION"} <= kinds(read_all(client))
        bench.run(1.0)
    one = socket.create_connection(("127.0.0.1", port))
    other = socket.create_connection(("127.0.0.1", port))
    with one, other:
        bench.run(5.0)
        assert "HEARTBEAT" in kinds(read_all(one)) & kinds(read_all(other))


def test_tcp_clients_that_come_and_go_are_told_of(bench: Bench) -> None:
    port = free_port()
    bench.open(f"tcp:127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", port)) as client:
        who = f"127.0.0.1:{client.getsockname()[1]}"
        bench.run(1.0)
        assert bench.said == [f"{who} has connected (tcp:127.0.0.1:{port})"]
    bench.run(1.0)
    assert bench.said[1:] == [f"{who} has disconnected (tcp:127.0.0.1:{port})"]


def test_a_udp_partner_that_falls_silent_is_told_of_once(bench: Bench) -> None:
    port = free_port(socket.SOCK_DGRAM)
    bench.open(f"udpin:127.0.0.1:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as partner:
        for _ in range(2):
            partner.sendto(request_version(), ("127.0.0.1", port))
            bench.run(1.0)
        who = f"127.0.0.1:{partner.getsockname()[1]}"
        assert bench.said == [f"{who} has connected (udpin:127.0.0.1:{port})"]
        for real_s in (4.0, 6.0, 12.0):
            bench.real_s = real_s
            bench.run(1.0)
        assert bench.said[1:] == [f"{who} has been silent for 5 s (udpin:127.0.0.1:{port})"]
        partner.sendto(request_version(), ("127.0.0.1", port))
        bench.run(1.0)
        assert len(bench.said) == 3 and "has connected" in bench.said[2]


def test_every_collision_is_told_of_with_its_place_once_a_second_and_at_the_end() -> None:
    said: list[str] = []
    real_s = 0.0
    log = EventLog(said.append, lambda: real_s)
    simulator = open_ground()
    log.look(simulator)
    touched: list[Collision] = []
    stand_in = SimpleNamespace(start=simulator.start, collisions=touched, commands=())
    start = simulator.start
    touched.append(Collision(61.3, start.north_m + 3.0, start.east_m - 1.5, None, 0.62))
    log.look(cast(Simulator, stand_in))
    assert said == [
        "collision 1: the rover, driving 0.6 m/s, touched an obstacle at 61.3 s, north 3.0 m, east -1.5 m of its start"
    ]
    for _ in range(3):
        touched.append(Collision(61.5, start.north_m, start.east_m, "cart", 1.0))
        log.look(cast(Simulator, stand_in))
    assert len(said) == 1
    real_s = 1.5
    log.look(cast(Simulator, stand_in))
    assert [line[:53] for line in said[1:]] == [
        f"collision {n}: the rover, driving 1.0 m/s, touched cart" for n in (2, 3, 4)
    ]
    touched.append(Collision(61.6, start.north_m, start.east_m, "cart", 1.0))
    log.look(cast(Simulator, stand_in))
    assert len(said) == 4
    log.end(cast(Simulator, stand_in))
    assert len(said) == 5 and said[4].endswith("at 61.6 s, north 0.0 m, east 0.0 m of its start")


def test_a_rebooting_vehicle_drops_its_tcp_clients(bench: Bench) -> None:
    port = free_port()
    bench.open(f"tcp:127.0.0.1:{port}")
    packer = mavlink.MAVLink(None, 255, 190)
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(mavlink.MAVLink_command_long_message(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0).pack(packer))
        bench.run(2.0)
        client.settimeout(1.0)
        while client.recv(65536):
            pass
        assert "dropped: the autopilot restarts" in bench.said[-1]
    with socket.create_connection(("127.0.0.1", port)) as client:
        bench.run(5.0)
        assert "HEARTBEAT" in kinds(read_all(client))


def test_the_clock_of_a_lidar_goes_on_while_the_simulator_stands_still() -> None:
    """As that of a real one does: what it sends after it is not late."""
    simulator = open_ground(lidars=[MountedLidar(MAKES["LD19"])])
    heard: list[tuple[float, int]] = []
    now_s = 0.0

    def clock() -> float:
        nonlocal now_s
        now_s += 1.5 if len(heard) == 10 else 0.01
        return now_s

    def listen() -> None:
        if data := simulator.lidars[0].take():
            heard.append((now_s, int.from_bytes(data[-3:-1], "little")))  # its time in ms, before the check sum

    serve(simulator, [], clock, 1.0, lambda: now_s < 10.0, observe=listen)
    began_s, began_ms = heard[1]
    late_s = [time_s - began_s - (told_ms - began_ms) / 1000.0 for time_s, told_ms in heard[1:]]
    assert max(np.diff([time_s for time_s, _ in heard])) > 1.5 and simulator.time_s < 9.0, "it stood still"
    assert max(map(abs, late_s[-50:])) < 0.1


def test_udp_out_sends_first_and_hears_answers(bench: Bench) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as partner:
        partner.bind(("127.0.0.1", 0))
        bench.open(f"udpout:127.0.0.1:{partner.getsockname()[1]}")
        bench.run(2.0)
        data, vehicle = partner.recvfrom(65536)
        assert data[0] == 0xFD
        read_all(partner)
        partner.sendto(request_version(), vehicle)
        bench.run(2.0)
        assert "AUTOPILOT_VERSION" in kinds(read_all(partner))


def test_datagrams_hold_whole_packets() -> None:
    packets = [
        request_version(),
        bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mavlink.MAVLink(None))),
    ]
    old = bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mavlink.MAVLink(None), force_mavlink1=True))
    stream = b"".join([*packets, old] * 200)
    pieces = datagrams(stream)
    assert b"".join(pieces) == stream
    assert max(map(len, pieces)) <= 1400
    assert len(pieces) < len(stream) / 1300
    for piece in pieces:
        found = mavlink.MAVLink(None).parse_buffer(piece) or []
        assert sum(len(message.get_msgbuf()) for message in found) == len(piece)
    assert datagrams(b"") == []


def test_udp_out_without_a_partner_goes_on(bench: Bench) -> None:
    bench.open(f"udpout:127.0.0.1:{free_port(socket.SOCK_DGRAM)}")
    bench.run(10.0)
    assert bench.simulator.time_s >= 10.0


def test_udp_in_answers_whoever_speaks(bench: Bench) -> None:
    port = free_port(socket.SOCK_DGRAM)
    bench.open(f"udpin:127.0.0.1:{port}")
    for _ in range(2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as partner:
            partner.sendto(request_version(), ("127.0.0.1", port))
            bench.run(2.0)
            assert "AUTOPILOT_VERSION" in kinds(read_all(partner))


def test_a_port_in_use_is_one_line(bench: Bench) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(ListenError, match=r"cannot be opened.*choose another port"):
            bench.open(f"tcp:127.0.0.1:{other.getsockname()[1]}")


def test_an_address_of_another_computer_is_not_taken_for_a_busy_port(bench: Bench) -> None:
    with pytest.raises(ListenError, match=r"cannot be opened.*is that an address of this computer\?"):
        bench.open("tcp:192.0.2.1:5760")


@pytest.mark.parametrize("url", ["tcp", "serial", "pty:", "usb:/dev/x:57600", "tcp:127.0.0.1", "tcp:127.0.0.1:x"])
def test_bad_addresses_are_told(bench: Bench, url: str) -> None:
    with pytest.raises(ListenError, match="not an address"):
        bench.open(url)


@pytest.mark.parametrize("port", ["0", "65536", "99999", "9" * 5000])
def test_a_port_that_is_none_is_told(bench: Bench, port: str) -> None:
    with pytest.raises(ListenError, match=r"is not a port; choose one from 1 to 65535"):
        bench.open(f"udpin:127.0.0.1:{port}")


def test_serve_refuses_bad_input_with_one_line_and_exit_code_2(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text("[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n")
    port = free_port()
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        for arguments in ([str(tmp_path / "none.toml")], [str(mission), "--listen", f"tcp:127.0.0.1:{port}"]):
            result = CliRunner().invoke(app, ["serve", *arguments])
            assert result.exit_code == 2
            assert len(result.output.strip().splitlines()) == 1
