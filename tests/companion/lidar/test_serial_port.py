"""A lidar's serial port: real pseudo-terminals, read by a thread."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
import serial

from companion.core.clock import WallClock
from companion.core.scan import RangeScan
from companion.lidar.reader import LidarReader, lidars_on
from companion.lidar.serial_port import QUEUE_BYTES, SerialLidarPort, open_ports
from companion.lidar.spec import LidarError, parsed
from tests.support.lidars import faulty, spinning
from tests.support.served import wait_until


class NoLog:
    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Nothing."""


def scans_of(reader: LidarReader, count: int) -> list[RangeScan]:
    found: list[RangeScan] = []

    def enough() -> bool:
        found.extend(reader.poll(WallClock().now_s(), NoLog()))
        return len(found) >= count

    wait_until(enough)
    return found


@pytest.mark.parametrize("name", ["LD19", "RPLIDAR-C1", "YDLIDAR-X4"])
def test_it_starts_the_lidar_reads_it_and_finds_it_again_after_the_cable_was_pulled(tmp_path: Path, name: str) -> None:
    spec = parsed(f"{name}:{tmp_path / 'tty'}")
    with spinning(tmp_path / "tty", name) as lidar:
        port = SerialLidarPort(spec, WallClock())
        reader = LidarReader(spec, port, 1)
        assert scans_of(reader, 2)[-1].looks_ahead
        lidar.device.faults = faulty(unplugged=True)
        wait_until(lambda: not os.path.lexists(tmp_path / "tty"))
        lidar.device.faults = faulty()
        wait_until(lambda: any(not chunk.data for chunk in port.read()))
        assert scans_of(reader, 2)[-1].looks_ahead
        reader.close()
        reader.close()


def test_what_nobody_reads_is_dropped_and_that_is_told(tmp_path: Path) -> None:
    with spinning(tmp_path / "tty"):
        port = SerialLidarPort(parsed(f"LD19:{tmp_path / 'tty'}"), WallClock())
        port._put(bytes(QUEUE_BYTES))
        wait_until(lambda: port._queued < QUEUE_BYTES)
        assert port.read()[0].data == b""
        port.close()


def test_a_port_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(LidarError) as raised:
        open_ports([parsed(f"LD19:{tmp_path / 'none'}")], WallClock())
    assert str(raised.value).startswith(
        f"lidar 'LD19:{tmp_path / 'none'}': {tmp_path / 'none'} cannot be opened: there is"
    )
    assert "\n" not in str(raised.value)


def test_if_one_of_two_ports_fails_the_other_is_closed_again(tmp_path: Path) -> None:
    with spinning(tmp_path / "tty"):
        specs = [parsed(f"LD19:{tmp_path / name}") for name in ("tty", "none")]
        with pytest.raises(LidarError):
            open_ports(specs, WallClock())
        lidars_on(specs[:1], open_ports(specs[:1], WallClock())).close()  # it would be in use


def test_a_command_never_waits_for_the_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with spinning(tmp_path / "tty"):
        port, ready, written = SerialLidarPort(parsed(f"LD19:{tmp_path / 'tty'}"), WallClock()), threading.Event(), []

        def slow(line: serial.Serial, data: bytes) -> None:
            ready.wait(5.0)
            written.append(data)

        monkeypatch.setattr(serial.Serial, "write", slow)
        port.write(b"stop")
        port.write(b"scan")
        assert written == []
        ready.set()
        wait_until(lambda: written == [b"stop", b"scan"])
        port.close()
