"""``rover-sitl physics`` as a process: a stand-in for the firmware asks it over UDP; the lidar has its own line."""

from __future__ import annotations

import re
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.mission.load import load_mission
from sitl.cli.commands import app
from sitl.firmware.physics_server import received
from sitl.scenario import scenario_from_mission, with_sensors
from tests.sitl.network.test_server import free_port
from tests.support.firmware import Firmware, frame
from tests.support.forked import Forked
from tests.support.served import process

ROOT = Path(__file__).resolve().parents[2]
MISSION = ROOT / "missions" / "one-obstacle.toml"
TRIES = 3


@contextmanager
def asking(port: int) -> Iterator[Callable[[bytes], bytes]]:
    """The firmware's socket: it is bound nowhere, sends, and waits for what comes back; after a while it asks again."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.settimeout(1.0)

        def exchange(datagram: bytes) -> bytes:
            asked.sendto(datagram, ("127.0.0.1", port))
            try:
                return asked.recv(65000)
            except TimeoutError:
                return b""

        yield exchange


@contextmanager
def physics(*options: object) -> Iterator[tuple[Forked, int]]:
    """The process, once it listens, and its port; another one where a program beside it was quicker."""
    for _ in range(TRIES):
        port = free_port(socket.SOCK_DGRAM)
        with process("sitl", "physics", MISSION, "--port", port, *options) as child:
            if child.stdout.readline() == f"listening on udp 127.0.0.1:{port}\n":
                yield child, port
                return
            complaint = child.communicate()[1]
        assert "Address already in use" in complaint
    raise AssertionError(complaint)


def stopped(child: Forked, number: signal.Signals) -> list[str]:
    """What it still says after a signal; it ends with exit code 0 and no complaint."""
    child.send_signal(number)
    said = child.stdout.read().splitlines()
    assert (child.wait(10.0), child.stderr.read()) == (0, "")
    return said


def test_a_firmware_drives_and_starts_again_and_the_physics_ends_cleanly(tmp_path: Path) -> None:
    file = tmp_path / "rover.parm"
    with physics("--sensors", "beams", "--write-params", file) as (child, port):
        with asking(port) as exchange:
            one = Firmware(exchange, rate_hz=200)
            one.drive(1.0, 1750, 1750)
            assert exchange(b"what is this?") == b""
            one.drive(1.0, 1750, 1750)
        assert one.state["velocity"][0] ** 2 + one.state["velocity"][1] ** 2 == pytest.approx(4.0, rel=0.01)
        assert all(0.0 < range_m <= 6.01 for range_m in one.ranges_m[:3])
        with asking(port) as exchange:
            again = Firmware(exchange, rate_hz=200, channels=32)
            again.drive(0.1)
        assert again.state["position"] == [0.0, 0.0, 0.0]
        said = stopped(child, signal.SIGINT)
    options = f"--sim-port-out {port} --home 53.1325000,23.1688000,120,90 --defaults {file}"
    assert said == [
        f"start the firmware with --model JSON:127.0.0.1 {options}",
        "the firmware has started and is answered",
        "a datagram was no frame of ArduPilot's JSON interface; ignored, like all that follow",
        "the firmware has started again: the rover is back at its start, the time is 0",
        "stopped; 420 steps, 1 not frames; since the firmware's last start 0 s and 0 collisions",
    ]

    lines = set(file.read_text(encoding="ascii").splitlines())
    assert {"SERVO1_FUNCTION 73", "OA_TYPE 0", "AVOID_ENABLE 0", "RNGFND2_ORIENT 7", "RNGFND3_MAX 6"} <= lines


def test_the_same_frames_get_the_same_bytes_in_another_process() -> None:
    scenario = scenario_from_mission(with_sensors(load_mission(MISSION), "beams"))
    here = scenario.physics(3)
    with physics("--sensors", "beams", "--seed", 3) as (_, port), asking(port) as exchange:
        for count in range(100):
            assert exchange(frame(count, 1700, 1650)) == here.answer(frame(count, 1700, 1650))


class Autopilot:
    """The other end of the lidar's line: an ArduPilot with a system id that sends heartbeats and listens."""

    def __init__(self, system: int) -> None:
        self._beats = mavlink.MAVLink(None, system, 1)
        self._parser = mavlink.MAVLink(None)
        self.said: list[Any] = []

    def beat(self) -> bytes:
        return bytes(mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(self._beats))

    def hear(self, data: bytes) -> None:
        self.said += self._parser.parse_buffer(data) or []

    def scans_from(self, system: int) -> list[Any]:
        return [m for m in self.said if m.get_type() == "OBSTACLE_DISTANCE" and m.get_srcSystem() == system]


def test_the_lidar_reaches_the_firmware_over_tcp_again_and_again() -> None:
    line = free_port()
    with (
        physics("--mavlink", f"tcp:127.0.0.1:{line}", "--sensors", "lidar-360") as (child, port),
        asking(port) as exchange,
    ):
        one = Firmware(exchange, rate_hz=50)
        one.drive(0.5)
        for system in (5, 6):
            autopilot = Autopilot(system)
            with socket.create_server(("127.0.0.1", line)) as server:
                server.settimeout(0.01)
                peer = None
                for _ in range(2000):
                    one.update()
                    try:
                        peer = server.accept()[0]
                        break
                    except TimeoutError:
                        continue
                assert peer is not None
                with peer:
                    peer.sendall(autopilot.beat())
                    peer.settimeout(5.0)
                    while len(autopilot.scans_from(5)) < 3:
                        one.drive(0.1)
                        autopilot.hear(peer.recv(65536))
            assert {m.get_srcComponent() for m in autopilot.said} == {196}
            assert autopilot.scans_from(5)[-1].distances[0] == 801
        one.drive(0.5)  # while frames come it looks at the link, and notices that the peer has gone
        # A line that comes back belongs to the same firmware; only a new start of it may have brought another id.
        assert not autopilot.scans_from(6)
        said = [text for text in stopped(child, signal.SIGTERM) if f":{line}" in text]
    url, peer = f"tcp:127.0.0.1:{line}", f"127.0.0.1:{line}"
    assert said[0] == f"waiting for {url}"
    assert said.count(f"scans go to {peer} (system 5)") == 2
    assert said.count(f"{peer}: link lost; waiting for {url}") == 2
    assert re.fullmatch(rf"{url}: \d+ packets of the lidar sent, \d+ lost without a peer", said[-1])


def test_the_lidar_reaches_a_ground_network_over_udp() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as network:
        network.settimeout(5.0)
        network.bind(("127.0.0.1", 0))
        url = f"udpout:127.0.0.1:{network.getsockname()[1]}"
        with physics("--mavlink", url) as (child, port), asking(port) as exchange:
            one = Firmware(exchange, rate_hz=100)
            autopilot = Autopilot(1)
            while len(autopilot.scans_from(1)) < 3:
                one.drive(0.1)
                autopilot.hear(network.recv(65536))
            assert stopped(child, signal.SIGTERM)[-1].startswith("stopped; ")


def test_a_frame_and_its_copy_that_waited_together_are_answered_once() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port, socket.socket(
        socket.AF_INET, socket.SOCK_DGRAM
    ) as sender:  # fmt: skip
        port.bind(("127.0.0.1", 0))
        port.setblocking(False)
        for datagram in (frame(0), frame(0), frame(0), frame(1), frame(0)):
            sender.sendto(datagram, port.getsockname())
        assert [data for data, _ in received(port)] == [frame(0), frame(1), frame(0)]


def refused(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["physics", *map(str, arguments)])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    return result.stderr


def test_bad_input_gets_one_line(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "none.toml")
    assert "not an address; write" in refused(MISSION, "--mavlink", "tcp:localhost")
    assert "--sensors: unknown sensors 'radar'" in refused(MISSION, "--sensors", "radar")
    assert "cannot be read" in refused(MISSION, "--params", tmp_path / "none.parm")
    many = tmp_path / "many.toml"
    many.write_text("[[beam]]\norientation = 0\nmin_m = 0.2\nmax_m = 6.0\n" * 7, encoding="utf-8")
    assert "7 rangefinders: the firmware accepts at most 6" in refused(MISSION, "--sensors", many)
    assert "cannot be written" in refused(MISSION, "--write-params", tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        assert f"udp 127.0.0.1:{port}: cannot be opened: Address already in use" in refused(MISSION, "--port", port)
