"""Serial lines, and several partners on one UDP port; the simulator's time is driven by the test."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.network import Endpoint, ListenError, open_endpoint
from sitl.network.serial import SerialEndpoint
from sitl.network.udp import MOST_CLIENTS, SILENT_S
from sitl.simulator import Simulator
from tests.sitl.network.test_server import free_port
from tests.support.party import split
from tests.support.sitl_client import open_ground

REQUEST_VERSION = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0)


class Bench:
    """A simulator with endpoints; real time is what the test says."""

    def __init__(self) -> None:
        self.simulator: Simulator = open_ground()
        self.endpoints: list[Endpoint] = []
        self.now_s = 100.0

    def open(self, url: str, serial_port: int = 0) -> Endpoint:
        self.endpoints.append(open_endpoint(url, self.simulator, serial_port=serial_port))
        return self.endpoints[-1]

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.exchange()
            self.simulator.advance_to_s(self.simulator.time_s + 0.1)
            self.now_s += 0.1
        self.exchange()

    def exchange(self) -> None:
        for endpoint in self.endpoints:
            endpoint.exchange(self.simulator, self.now_s)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    for endpoint in made.endpoints:
        endpoint.close()


def packed(message: Any, system: int = 255) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, system, 190)))


def beat(system: int = 255) -> bytes:
    return packed(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system)


def kinds(data: bytes) -> list[str]:
    return [m.get_type() for m in mavlink.MAVLink(None).parse_buffer(data) or []]


# Serial lines


def test_a_pseudo_terminal_is_a_serial_port_to_others(bench: Bench, tmp_path: Path) -> None:
    name = tmp_path / "ttyV0"
    endpoint = bench.open(f"pty:{name}")
    bench.run(1.0)
    with serial.Serial(str(name), 57600, timeout=0) as port:
        port.write(packed(REQUEST_VERSION))
        data = b""
        for _ in range(20):
            bench.run(0.1)
            data += port.read(65536)
    assert {"COMMAND_ACK", "AUTOPILOT_VERSION", "HEARTBEAT"} <= set(kinds(data))
    endpoint.close()
    bench.endpoints.clear()
    assert not name.is_symlink()


def test_a_line_that_nobody_reads_loses_whole_packets(bench: Bench, tmp_path: Path) -> None:
    name = tmp_path / "ttyV0"
    bench.open(f"pty:{name}")
    bench.run(60.0)
    with contextlib.closing(Terminal(name)) as port:
        data = b""
        for _ in range(30):
            data += port.read()
            bench.run(0.1)
        packets = split(data)
    # Everything that came through is whole: pymavlink finds as many messages as there are headers.
    assert len(kinds(data)) == len([packet for packet in packets if len(packet) > 12])
    assert len(data) > 4000
    assert "HEARTBEAT" in kinds(data)


class SlowLine:
    """Takes so many bytes in each exchange, in bites of ten."""

    def __init__(self, room: int) -> None:
        self.room = self.left = room
        self.sent = b""

    def descriptor(self) -> None:
        return None

    def reopen(self, now_s: float) -> None:
        """Called before every exchange."""
        self.left = self.room

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> int:
        taken = min(self.left, 10, len(data))
        self.left -= taken
        self.sent += data[:taken]
        return taken

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize("room", [7, 10, 95, 1000])
def test_packets_stay_whole_on_a_line_that_takes_little(bench: Bench, room: int) -> None:
    line = SlowLine(room)
    bench.endpoints.append(SerialEndpoint(line, bench.simulator, 0))
    bench.run(60.0)
    packets = split(line.sent)
    found = kinds(line.sent)
    assert len(found) > 10
    assert len(found) in (len(packets), len(packets) - 1), "the last one may still be under way"
    assert all(packet[0] == 0xFD for packet in packets)


class Terminal:
    """The other end of a pseudo-terminal, read without throwing away what waits there."""

    def __init__(self, path: Path) -> None:
        self.file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def read(self) -> bytes:
        try:
            return os.read(self.file, 65536)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        os.close(self.file)


def test_a_left_over_name_is_taken_and_a_file_is_not(bench: Bench, tmp_path: Path) -> None:
    left = tmp_path / "ttyV0"
    left.symlink_to("/dev/pts/99999")
    bench.open(f"pty:{left}")
    assert left.resolve().exists()
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with pytest.raises(ListenError, match=r"notes\.txt: cannot be opened: File exists; name a link"):
        bench.open(f"pty:{file}")
    assert file.read_text() == "mine"
    with pytest.raises(ListenError, match="cannot be opened: No such file"):
        bench.open(f"pty:{tmp_path}/none/ttyV0")


@pytest.mark.parametrize("baud", ["0", "99999999999", "4000001"])
def test_a_speed_that_no_line_has(bench: Bench, tmp_path: Path, baud: str) -> None:
    """Zero would hang up, and what does not fit into the system's field is no speed."""
    name = tmp_path / "ttyV0"
    bench.open(f"pty:{name}")
    with pytest.raises(ListenError, match=f"ttyV0:{baud}: {baud} is not a baud rate; choose one up to 4000000"):
        bench.open(f"serial:{name}:{baud}")


def test_the_name_of_a_terminal_in_use_is_left_alone(bench: Bench, tmp_path: Path) -> None:
    name = tmp_path / "ttyV0"
    bench.open(f"pty:{name}")
    terminal = os.readlink(name)
    with pytest.raises(ListenError, match=r"File exists, perhaps another rover-sitl has it; name a link that does"):
        bench.open(f"pty:{name}")
    assert os.readlink(name) == terminal


def test_a_serial_device_may_be_pulled_out_and_put_in_again(bench: Bench, tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    ours, theirs = os.openpty()
    device.symlink_to(os.ttyname(theirs))
    bench.open(f"serial:{device}:57600")
    assert "HEARTBEAT" in kinds(run_and_read(bench, ours))
    device.unlink()
    os.close(ours)
    os.close(theirs)
    bench.run(2.0)
    ours, theirs = os.openpty()
    device.symlink_to(os.ttyname(theirs))
    assert "HEARTBEAT" in kinds(run_and_read(bench, ours))
    os.write(ours, packed(REQUEST_VERSION))
    assert {"HEARTBEAT", "COMMAND_ACK"} <= set(kinds(run_and_read(bench, ours)))
    os.close(ours)
    os.close(theirs)


def run_and_read(bench: Bench, file: int) -> bytes:
    """Three seconds, in which the other end of the line is read all the time: its buffer is small."""
    os.set_blocking(file, False)
    data = b""
    for _ in range(30):
        bench.run(0.1)
        with contextlib.suppress(BlockingIOError):
            data += os.read(file, 65536)
    return data


@pytest.mark.parametrize("place", ["/dev/none", "/dev/none:57600", "/dev/null:9600"])
def test_a_device_that_is_not_there_is_one_line(bench: Bench, place: str) -> None:
    with pytest.raises(
        ListenError, match=r"^serial:/dev/.* cannot be opened: .*; check that the device exists"
    ) as told:
        bench.open(f"serial:{place}")
    assert "\n" not in str(told.value) and "Errno" not in str(told.value)
    assert str(told.value).count("/dev/") == 1


# UDP


def udp(port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.connect(("127.0.0.1", port))
    made.settimeout(0.01)
    return made


def read_all(connection: socket.socket) -> bytes:
    data = b""
    with contextlib.suppress(TimeoutError):
        while len(data) < 1_000_000:
            data += connection.recv(65536)
    return data


def test_every_partner_on_one_udp_port_has_a_link_of_its_own(bench: Bench) -> None:
    port = free_port(socket.SOCK_DGRAM)
    bench.open(f"udpin:127.0.0.1:{port}")
    with udp(port) as one, udp(port) as other:
        one.send(beat(255))
        other.send(beat(254))
        bench.run(5.0)
        read_all(one), read_all(other)
        one.send(packed(REQUEST_VERSION, 255))
        told = packed(mavlink.MAVLink_named_value_float_message(1, b"room", 2.5), 255)
        one.send(told)
        bench.run(1.0)
        mine, his = read_all(one), read_all(other)
    assert "AUTOPILOT_VERSION" in kinds(mine)
    assert "AUTOPILOT_VERSION" not in kinds(his)
    assert told in his
    assert told not in mine
    assert "HEARTBEAT" in kinds(mine)
    assert "HEARTBEAT" in kinds(his)


def test_the_silent_are_forgotten_but_the_last_one_is_not(bench: Bench) -> None:
    port = free_port(socket.SOCK_DGRAM)
    bench.open(f"udpin:127.0.0.1:{port}")
    with udp(port) as one, udp(port) as other:
        one.send(beat())
        bench.run(SILENT_S + 10.0)
        read_all(one)
        bench.run(2.0)
        assert "HEARTBEAT" in kinds(read_all(one))
        other.send(beat())
        bench.run(2.0)
        read_all(one)
        bench.run(2.0)
        assert read_all(one) == b""
        assert "HEARTBEAT" in kinds(read_all(other))


def test_when_there_are_too_many_the_longest_silent_goes(bench: Bench) -> None:
    port = free_port(socket.SOCK_DGRAM)
    bench.open(f"udpin:127.0.0.1:{port}")
    with contextlib.ExitStack() as stack:
        partners = [stack.enter_context(udp(port)) for _ in range(MOST_CLIENTS + 1)]
        for partner in partners:
            partner.send(beat())
            bench.run(0.5)
        for partner in partners:
            read_all(partner)
        bench.run(2.0)
        assert [bool(read_all(partner)) for partner in partners] == [False] + [True] * MOST_CLIENTS
