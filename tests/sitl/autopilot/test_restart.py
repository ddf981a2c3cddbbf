"""Whoever restarts the autopilot is told that it will, on every kind of connection."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.sitl.network.test_endpoints import Bench, beat, bench, packed, read_all, udp
from tests.sitl.network.test_server import free_port

__all__ = ["bench"]
RESTART = packed(mavlink.MAVLink_command_long_message(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0))


class Partner:
    """Somebody at the other end: speaks, and reads all that has come since it was last asked."""

    def __init__(self, speak: Callable[[bytes], object], read: Callable[[], bytes]) -> None:
        self.speak, self.read = speak, read


def file_partner(file: int, stack: contextlib.ExitStack) -> Partner:
    """Somebody at a terminal."""
    os.set_blocking(file, False)
    stack.callback(os.close, file)

    def read() -> bytes:
        with contextlib.suppress(BlockingIOError):
            return os.read(file, 65536)
        return b""

    return Partner(lambda data: os.write(file, data), read)


def partner(kind: str, bench: Bench, folder: Path, stack: contextlib.ExitStack) -> Partner:
    """An endpoint of this kind, and who is there."""
    if kind == "pty":
        bench.open(f"pty:{folder}/tty")
        return file_partner(os.open(folder / "tty", os.O_RDWR | os.O_NOCTTY), stack)
    if kind == "serial":
        ours, theirs = os.openpty()
        stack.callback(os.close, theirs)
        bench.open(f"serial:{os.ttyname(theirs)}")
        return file_partner(ours, stack)
    if kind == "udpout":
        here = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        here.bind(("127.0.0.1", 0))
        here.settimeout(0.01)
        bench.open(f"udpout:127.0.0.1:{here.getsockname()[1]}")
        bench.run(2.0)
        here.connect(here.recvfrom(65536)[1])
        return Partner(here.send, lambda: read_all(here))
    port = free_port(socket.SOCK_DGRAM if kind == "udpin" else socket.SOCK_STREAM)
    bench.open(f"{kind}:127.0.0.1:{port}")
    caller = udp(port) if kind == "udpin" else socket.create_connection(("127.0.0.1", port))
    caller.settimeout(0.1)
    stack.enter_context(caller)

    def read() -> bytes:
        with contextlib.suppress(TimeoutError):
            return caller.recv(65536)
        return b""

    return Partner(caller.send, read)


@pytest.mark.parametrize("kind", ["tcp", "udpin", "udpout", "pty", "serial"])
def test_a_restart_is_acknowledged_and_the_link_works_on(kind: str, bench: Bench, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        one = partner(kind, bench, tmp_path, stack)
        for _ in range(20):
            one.speak(beat())
            bench.run(0.1)
            one.read()
        before_us = bench.simulator.vehicle.time_us
        one.speak(RESTART)
        bench.run(0.1)
        bench.exchange()
        answers = mavlink.MAVLink(None).parse_buffer(one.read()) or []
        acks = [(m.command, m.result) for m in answers if m.get_type() == "COMMAND_ACK"]
        assert acks == [(246, mavlink.MAV_RESULT_ACCEPTED)]
        assert bench.simulator.vehicle.time_us < before_us
        if kind == "tcp":
            return  # hung up, as the firmware does
        heard = b""
        for _ in range(30):
            bench.run(0.1)
            heard += one.read()
        assert "HEARTBEAT" in [m.get_type() for m in mavlink.MAVLink(None).parse_buffer(heard) or []]
