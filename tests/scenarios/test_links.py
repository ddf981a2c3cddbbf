"""``rover-sitl serve`` as a process of its own, with several partners at once on different kinds of links."""

from __future__ import annotations

import os
import random
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from companion.core.clock import WallClock
from tests.sitl.network.test_server import free_port
from tests.support.rig import yard
from tests.support.served import PATIENCE_S, Served, finished, mission_path, process

KEY = bytes(range(1, 33))
TEXT = "from the companion"


class Line:
    """A vehicle behind ``rover-sitl serve`` on TCP, UDP and a pseudo-terminal: SERIAL0, SERIAL1 and SERIAL2."""

    def __init__(self, folder: Path) -> None:
        tcp, udp = free_port(), free_port(socket.SOCK_DGRAM)
        self.addresses = (tcp, udp)
        self.listen = [f"tcp:127.0.0.1:{tcp}", f"udpin:127.0.0.1:{udp}", f"pty:{folder}/ttyV0"]
        self.urls = [f"tcp:127.0.0.1:{tcp}", f"udpout:127.0.0.1:{udp}", f"{folder}/ttyV0"]

    @property
    def arguments(self) -> list[str]:
        return [part for url in self.listen for part in ("--listen", url)]


@pytest.fixture(autouse=True, scope="module")
def mavlink_2() -> None:
    """What mavutil wants to see before it knows MAVLink 2's messages; it sets this itself when it has heard some."""
    os.environ["MAVLINK20"] = "1"


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Line]:
    """One vehicle for all tests here, as it would be for a day."""
    folder = tmp_path_factory.mktemp("line")
    made = Line(folder)
    mission = mission_path(yard(folder))
    with process("sitl", "serve", mission, *made.arguments, "--speedup", 20) as child:
        for url in made.listen:
            assert child.stdout.readline() == f"listening on {url}\n"
        yield made
        assert child.poll() is None, "still up"


def connect(url: str, system: int, component: int) -> Any:
    made = mavutil.mavlink_connection(url, source_system=system, source_component=component, dialect="ardupilotmega")
    made.mav.heartbeat_send(18, 8, 0, 0, 4)
    return made


def wait(connection: Any, fits: Callable[[Any], bool]) -> Any:
    stop_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < stop_s:
        message = connection.recv_match(blocking=True, timeout=0.5)
        if message is not None and fits(message):
            return message
    pytest.fail("not heard")


def answered(connection: Any, command: int, *parameters: float) -> int:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    connection.mav.command_long_send(1, 1, command, 0, *filled)
    return int(wait(connection, lambda m: m.get_type() == "COMMAND_ACK" and m.command == command).result)


def test_ground_station_companion_and_tool_at_once(line: Line) -> None:
    ground, companion, tool = (
        connect(url, *who) for url, who in zip(line.urls, ((255, 190), (1, 191), (254, 190)), strict=True)
    )
    try:
        for party in (ground, companion, tool):
            wait(party, lambda m: m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1)
        # The companion speaks: everybody else hears it.
        companion.mav.heartbeat_send(18, 8, 0, 0, 4)
        companion.mav.statustext_send(6, TEXT.encode())
        for party in (ground, tool):
            heard = wait(party, lambda m: m.get_type() == "STATUSTEXT" and m.text == TEXT)
            assert (heard.get_srcSystem(), heard.get_srcComponent()) == (1, 191)
        # The scanner on the vehicle's network is heard everywhere.
        for party in (ground, companion, tool):
            wait(party, lambda m: m.get_type() == "OBSTACLE_DISTANCE" and m.get_srcComponent() == 196)
        # A command for the companion arrives there, its answer comes back.
        ground.mav.command_long_send(1, 191, 31000, 0, 0, 0, 0, 0, 0, 0, 0)
        asked = wait(companion, lambda m: m.get_type() == "COMMAND_LONG" and m.command == 31000)
        companion.mav.command_ack_send(31000, 0, 0, 0, asked.get_srcSystem(), asked.get_srcComponent())
        back = wait(ground, lambda m: m.get_type() == "COMMAND_ACK" and m.command == 31000)
        assert back.get_srcComponent() == 191
        # Each commands the one vehicle.
        for party, mode in ((ground, 4), (companion, 15), (tool, 0)):
            assert answered(party, 176, 1, mode) == 0
            for listener in (ground, companion, tool):
                wait(
                    listener,
                    lambda m, mode=mode: (
                        m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1 and m.custom_mode == mode
                    ),
                )
    finally:
        for party in (ground, companion, tool):
            party.close()


def test_a_megabyte_of_noise_on_every_port(line: Line) -> None:
    noise = random.Random(1).randbytes(1_000_000)
    tcp, udp = line.addresses
    with socket.create_connection(("127.0.0.1", tcp), timeout=PATIENCE_S) as flood:
        flood.sendall(noise)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood:
        for at in range(0, len(noise), 1000):
            flood.sendto(noise[at : at + 1000], ("127.0.0.1", udp))
        flood.sendto(b"", ("127.0.0.1", udp))
    terminal = os.open(line.urls[2], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    sent, stop_s = 0, time.monotonic() + PATIENCE_S
    while sent < len(noise) and time.monotonic() < stop_s:
        try:
            sent += os.write(terminal, noise[sent : sent + 4000])
        except BlockingIOError:
            time.sleep(0.001)
    assert sent == len(noise)
    os.close(terminal)
    for url, who in zip(line.urls, ((255, 190), (1, 191), (254, 190)), strict=True):
        party = connect(url, *who)
        try:
            beat = wait(party, lambda m: m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1)
            assert (beat.custom_mode, beat.base_mode & 128) == (0, 0)
            assert answered(party, 512, 148) == 0
        finally:
            party.close()


def test_mavutils_own_signing_and_a_stranger(line: Line) -> None:
    owner, stranger = connect(line.urls[0], 255, 190), connect(line.urls[1], 254, 190)
    try:
        wait(owner, lambda m: m.get_type() == "HEARTBEAT")
        wait(stranger, lambda m: m.get_type() == "HEARTBEAT")
        now = int((time.time() - 1420070400) * 1e5)
        owner.mav.setup_signing_send(1, 1, list(KEY), now)
        owner.setup_signing(KEY, sign_outgoing=True, initial_timestamp=now)
        wait(owner, lambda m: m.get_type() == "HEARTBEAT" and m.get_signed())
        assert answered(owner, 176, 1, 4) == 0
        # The stranger still hears the vehicle, but it does not listen to him, until he has the key.
        stranger.mav.command_long_send(1, 1, 176, 0, 1, 15, 0, 0, 0, 0, 0)
        stop_s = time.monotonic() + 1.0
        while time.monotonic() < stop_s:
            message = stranger.recv_match(blocking=True, timeout=0.2)
            assert message is None or message.get_type() != "COMMAND_ACK"
        stranger.setup_signing(KEY, sign_outgoing=True)
        assert answered(stranger, 176, 1, 15) == 0
        assert answered(owner, 176, 1, 4) == 0
        assert owner.mav.signing.badsig_count == 0
    finally:
        owner.close()
        stranger.close()


@pytest.mark.slow
def test_the_companion_drives_over_a_serial_line_while_a_ground_station_watches(tmp_path: Path) -> None:
    mission = yard(tmp_path, '[[target]]\nname = "near"\nfield = [4, 7]\n')
    name = tmp_path / "ttyV0"
    world = Served(mission, f"pty:{name}")
    ground = connect(world.url, 255, 190)
    texts: list[str] = []
    try:
        with process("companion", "run", mission_path(mission), "--connect", f"serial:{name}:57600", "--arm") as run:
            limit_s = WallClock().now_s() + PATIENCE_S
            while run.poll() is None and WallClock().now_s() < limit_s:
                message = ground.recv_match(type=["STATUSTEXT"], blocking=True, timeout=0.5)
                if message is not None and message.get_srcComponent() == 191:
                    texts.append(message.text)
            code, out, err = finished(run)
    finally:
        ground.close()
        world.close()
    assert code == 0, err
    assert "near: reached" in out
    assert any("near" in text for text in texts)
