"""Two programs that share nothing but a socket, in real time."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from companion.mapping.map_files import load_map
from companion.recording.reader import load_record
from companion.replay.replay import replay
from tests.sitl.network.test_server import free_port
from tests.support.rig import yard
from tests.support.served import finished, interpreter, mission_path, process


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "kind", "speedup"),
    [
        pytest.param(process, "udp", 1.0, id="udp"),
        pytest.param(interpreter, "tcp", 2.0, id="tcp", marks=pytest.mark.thorough),
    ],
)
def test_companion_and_simulator_as_two_processes(
    tmp_path: Path, start: Callable[..., Any], kind: str, speedup: float
) -> None:
    """From switching on (43 s of the vehicle's time until it can be armed) to the target behind the wall."""
    mission = yard(tmp_path)
    path = mission_path(mission)
    if speedup > 1.0:  # what is twice as fast must look no faster than a rover does
        path.write_text(path.read_text().replace("cruise_speed_m_s = 2.0", "cruise_speed_m_s = 1.0"))
    port = free_port(socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM)
    listen, connect = {"udp": ("udpout", "udpin"), "tcp": ("tcp", "tcp")}[kind]
    record = tmp_path / "record"
    with (
        start("sitl", "serve", path, "--listen", f"{listen}:127.0.0.1:{port}", "--speedup", speedup),
        start("companion", "run", path, "--connect", f"{connect}:127.0.0.1:{port}", "--arm", "--record", record) as run,
    ):
        code, out, err = finished(run)
    assert code == 0, err
    assert "gate: reached" in out
    for said in ("waiting for", "Heading for gate", "driving", "Mission ended: 1 of 1"):
        assert said in err
    assert "Traceback" not in err
    assert (record / "link.tlog").stat().st_size > 10_000
    again = replay(load_record(record))
    assert again.differences == [] and again.decisions > 10
    known = load_map(record / "map.yaml")
    assert known.weights[7, 8] >= 1.0, "the wall"
