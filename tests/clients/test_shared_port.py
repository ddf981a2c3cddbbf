"""One serial port, several programs: the recipes of docs/ports.md on a pseudo-terminal, and a thief on it."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink import mavutil

from tests.clients.program import Program, installed, ours, program
from tests.docs.test_docs import blocks
from tests.sitl.network.test_server import free_port
from tests.support.rig import GUIDED, yard
from tests.support.served import PATIENT, Served, mission_path, wait_until

ROUTER = os.environ.get("MAVLINK_ROUTERD") or shutil.which("mavlink-routerd")
UART, UDP = "/dev/autopilot", 14551


class Rover(Served):
    """A simulated rover in real time whose serial port is a pseudo-terminal."""

    def __init__(self, folder: Path) -> None:
        self.device = folder / "autopilot"
        self.mission = yard(folder)
        super().__init__(self.mission, f"pty:{self.device}")


@pytest.fixture
def rover(tmp_path: Path) -> Iterator[Rover]:
    made = Rover(tmp_path)
    yield made
    made.close()


def recipe(begins: str) -> str:
    (text,) = (text for where, text in blocks("text") if where.startswith("ports.md") and text.startswith(begins))
    return text


def drives(rover: Rover, folder: Path, udp: int) -> None:
    """The companion drives through the router; a ground station on another of its ports sees it."""
    settings = folder / "patient.toml"
    settings.write_text(PATIENT)
    run = ["run", mission_path(rover.mission), "--connect", f"udpin:127.0.0.1:{udp}", "--arm"]
    with ours(folder, "companion", *run, "--settings", settings, "--state", folder / "state") as companion:
        companion.says("Heading for gate")
        wait_until(lambda: rover.simulator.driven_m > 0.5)
        assert rover.mode() == GUIDED and rover.simulator.collisions == ()


def watches(url: str) -> None:
    """A ground station on the router's other port hears rover and companion."""
    station = mavutil.mavlink_connection(url, source_system=255, source_component=190, dialect="ardupilotmega")
    station.mav.heartbeat_send(6, 8, 0, 0, 4)
    heard: set[int] = set()
    wait_until(lambda: _heard(station, heard) >= {1, 196})
    station.close()


def _heard(station: object, heard: set[int]) -> set[int]:
    while (message := station.recv_match(blocking=False)) is not None:  # type: ignore[attr-defined]
        heard.add(message.get_srcComponent())
    return heard


@pytest.mark.slow
@pytest.mark.skipif(ROUTER is None, reason="mavlink-routerd is not installed; docs/ports.md says how")
def test_mavlink_router_with_the_configuration_of_the_page(rover: Rover, tmp_path: Path) -> None:
    udp, tcp = free_port(socket.SOCK_DGRAM), free_port()
    text = recipe("[General]")
    for old, new in ((UART, str(rover.device)), (f"= {UDP}", f"= {udp}"), ("= 5760", f"= {tcp}")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "main.conf").write_text(text)
    with routed([str(ROUTER), "-c", str(tmp_path / "main.conf")]):
        drives(rover, tmp_path, udp)
        watches(f"tcp:127.0.0.1:{tcp}")


@contextmanager
def routed(command: list[str]) -> Iterator[None]:
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()


@contextmanager
def mavproxy(folder: Path, *arguments: object) -> Iterator[Program]:
    installed("MAVProxy", "MAVProxy")
    place = folder / "mavproxy"
    place.mkdir()
    files = ["--logfile", place / "mav.tlog", "--state-basedir", place]
    with program(place, "-m", "MAVProxy.mavproxy", *arguments, *files) as running:
        yield running


@pytest.mark.slow
def test_mavproxy_as_the_page_starts_it_and_it_loads_our_parameters(rover: Rover, tmp_path: Path) -> None:
    udp, other = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    words = recipe("mavproxy.py").split()[1:]
    change = {
        UART: str(rover.device),
        f"127.0.0.1:{UDP}": f"127.0.0.1:{udp}",
        "192.168.1.20:14550": f"127.0.0.1:{other}",
    }
    assert set(change) <= set(words) and words[-1] == "--daemon"
    with mavproxy(tmp_path, *(change.get(word, word) for word in words[:-1])) as ground:
        ground.says("online system 1")
        file = tmp_path / "rover.param"
        with ours(tmp_path, "companion", "params", "--write", file, "--guard", "--station") as writer:
            assert writer.ended() == 0
        ground.says(r"Received \d+ parameters")
        ground.told(f"param load {file}", r"Loaded 14 parameters from .* \(changed 4\)")
        check = ["params", "--check", "--guard", "--station", "--connect", f"udpin:127.0.0.1:{udp}"]
        with ours(tmp_path, "companion", *check, "--state", tmp_path / "checked") as checker:
            checker.says("all 14 are as wanted")
            assert checker.ended() == 0
        drives(rover, tmp_path, udp)
        watches(f"udpin:127.0.0.1:{other}")


@pytest.mark.slow
def test_the_doctor_names_who_takes_bytes_away(rover: Rover, tmp_path: Path) -> None:
    script = tmp_path / "thief.py"
    script.write_text(
        "import os, sys, time\n"
        "port = os.open(sys.argv[1], os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)\n"
        "while True:\n"
        "    try: os.read(port, 20)\n"
        "    except BlockingIOError: pass\n"
        "    time.sleep(0.001)\n"
    )
    link = f"serial:{rover.device}:115200"
    ask = ["doctor", "--json", "--seconds", 2, "--connect", link, "--state", tmp_path / "state"]
    with subprocess.Popen([sys.executable, str(script), str(rover.device)]) as thief:
        with ours(tmp_path, "companion", *ask) as doctor:
            assert doctor.ended() in (3, 4)
        thief.kill()
    (finding,) = (one for one in json.loads(doctor.output)["findings"] if one["name"] == "port-shared")
    assert finding["level"] == "stop" and finding["says"].startswith(
        f"thief.py (process {thief.pid}) has the same port"
    )
    assert "docs/ports.md" in finding["remedy"]
