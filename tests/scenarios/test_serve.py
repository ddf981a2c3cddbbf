"""``rover-sitl serve`` as a process of its own."""

import signal
import socket
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.sitl.network.test_server import free_port
from tests.support.served import PATIENCE_S, finished, process, wait_until


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_serves_twenty_times_as_fast_and_ends_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text("[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n")
    port = free_port()
    with process("sitl", "serve", mission, "--listen", f"tcp:127.0.0.1:{port}", "--speedup", 20) as child:
        assert child.stdout.readline() == f"listening on tcp:127.0.0.1:{port}\n"
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as client:
            parser, times_s = mavlink.MAVLink(None), []
            began_s = time.monotonic()
            while time.monotonic() < began_s + 1.5 or not times_s or times_s[-1] - times_s[0] < 10.0:
                for message in parser.parse_buffer(client.recv(65536)) or []:
                    if message.get_type() == "ATTITUDE":
                        times_s.append(message.time_boot_ms / 1000)
        took_s = time.monotonic() - began_s
        # Loosely: 30 s of the rover's time in 1.5 s, and more time for less on a busy machine.
        assert 10.0 <= times_s[-1] - times_s[0] < 30.0 * took_s
        assert "has connected" in child.stdout.readline() and "has disconnected" in child.stdout.readline()
        child.send_signal(number)
        assert child.wait(timeout=PATIENCE_S) == 0
        assert child.stdout.read().startswith("stopped after ")


def test_quiet_it_says_nothing(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text("[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n")
    port = free_port()
    with process("sitl", "serve", mission, "--quiet", "--listen", f"tcp:127.0.0.1:{port}") as child:
        wait_until(lambda: can_connect(port))
        child.send_signal(signal.SIGTERM)
        assert finished(child) == (0, "", "")


def can_connect(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError:
        return False
    return True
