"""``rover-sitl serve`` as a process of its own."""

import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.unit.test_sitl_server import free_port


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_serves_twenty_times_as_fast_and_ends_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text("[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n")
    port = free_port()
    arguments = ["serve", str(mission), "--listen", f"tcp:127.0.0.1:{port}", "--speedup", "20"]
    code = "from sitl.cli.main import main; main()"
    with subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == f"listening on tcp:127.0.0.1:{port}\n"
            with socket.create_connection(("127.0.0.1", port), timeout=5.0) as client:
                parser, times_s = mavlink.MAVLink(None), []
                began_s = time.monotonic()
                while time.monotonic() < began_s + 1.5:
                    for message in parser.parse_buffer(client.recv(65536)) or []:
                        if message.get_type() == "ATTITUDE":
                            times_s.append(message.time_boot_ms / 1000)
            # Loosely, as the machine may be busy: 30 s of the rover's time have passed.
            assert 10.0 < times_s[-1] - times_s[0] < 40.0
            process.send_signal(number)
            assert process.wait(timeout=5.0) == 0
        finally:
            process.kill()
