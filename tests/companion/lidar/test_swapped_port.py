"""A lidar on the port that is given as the autopilot's: doctor and run say so."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.lidar.models import MODELS, LidarModel
from companion.lidar.swapped_port import NAME, REMEDY, StrangePort, findings_of_port
from companion.mavlink.codec import Codec
from companion.settings import Settings
from tests.support.forked import LIMIT_S, Forked
from tests.support.lidars import room, started, stream
from tests.support.mavlink_vehicle import Station

NOISE = bytes(range(1, 250)) * 8


def sent_by(model: LidarModel) -> bytes:
    """What this lidar sends in half a second."""
    return stream(started(room(0.01, model.name), b"".join(model.start)), 0.5)


@contextmanager
def sending(data: bytes) -> Iterator[str]:
    """A pseudo-terminal on which these bytes come again and again; gives its name."""
    ours, theirs = os.openpty()
    over = threading.Event()

    def send() -> None:
        os.set_blocking(ours, False)
        while not over.is_set():
            with contextlib.suppress(OSError):  # nobody reads just now
                os.write(ours, data[:2000])
            time.sleep(0.05)

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        over.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_a_lidars_bytes_are_told_by_their_model(model: LidarModel) -> None:
    (found,) = findings_of_port("serial:x:1", sent_by(model)[-2048:], None)
    assert found.name == NAME and model.name in found.says and found.remedy == REMEDY


def test_at_a_wrong_speed_the_others_are_tried() -> None:
    data, tried = sent_by(MODELS[0]), []

    def listen(baud: int) -> bytes:
        tried.append(baud)
        return data if baud == MODELS[0].baud else NOISE

    assert [one.name for one in findings_of_port("serial:x:57600", NOISE, listen)] == [NAME]
    assert tried.count(MODELS[0].baud) == 1
    assert list(findings_of_port("serial:x:57600", b"", listen)) == []
    assert list(findings_of_port("udp:x", NOISE, None)) == []


def test_a_run_that_waits_is_told_once_what_comes_instead() -> None:
    said: list[str] = []
    for sample in (sent_by(MODELS[0])[-2048:], NOISE, b""):
        port = StrangePort("serial:x:1", said.append)
        for second in range(10):
            port.look(float(second), sample)
    lidar, noise = said
    assert lidar.startswith("serial:x:1 sends a lidar's data (those of an LD06 or an LD19)") and REMEDY in lidar
    assert noise.startswith("serial:x:1: bytes come, but no MAVLink")


def test_bytes_are_strange_until_a_packet_has_come() -> None:
    codec = Codec(Settings().link)
    codec.packets(NOISE)
    assert codec.strange == NOISE[-2048:]
    codec.packets(Station(1, 1).heartbeat(kind=10))
    codec.packets(NOISE)
    assert codec.strange == b""


@pytest.mark.thorough
def test_a_run_on_a_lidars_port_says_so_while_it_waits(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text("[[target]]\nnorth_m = 1\neast_m = 2\n")
    with sending(sent_by(MODELS[0])) as device:
        arguments = ["run", tmp_path / "m.toml", "--connect", f"serial:{device}:230400", "--state", tmp_path / "s"]
        with Forked("companion", arguments) as child:
            assert any("sends a lidar's data" in line for line in child.stderr)
            child.send_signal(signal.SIGINT)
            assert child.wait(timeout=LIMIT_S) == 130


def test_the_doctor_names_it_instead_of_silence() -> None:
    with sending(sent_by(MODELS[0])) as device:
        arguments = ["doctor", "--connect", f"serial:{device}:230400", "--seconds", "1", "--json"]
        done = CliRunner().invoke(app, arguments)
    names = [one["name"] for one in json.loads(done.stdout)["findings"]]
    assert done.exit_code == 4 and names[0] == NAME
    assert "no-autopilot" not in names and "port-damaged" not in names
