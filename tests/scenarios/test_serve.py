"""``rover-sitl serve`` as a process of its own."""

import json
import signal
import socket
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner
from websockets.sync.client import connect

from sitl.cli.commands import app
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
        wait_until(lambda: serves(port))
        child.send_signal(signal.SIGTERM)
        assert finished(child) == (0, "", "")


def serves(port: int) -> bool:
    """Whether packets come: a port can be connected to before anybody serves it."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as client:
            return bool(client.recv(1))
    except OSError:
        return False


def test_a_page_shows_the_simulator_and_ends_with_it(tmp_path: Path) -> None:
    mission = Path(__file__).resolve().parents[2] / "missions" / "depot.toml"
    listen = f"tcp:127.0.0.1:{free_port()}"
    with process("sitl", "serve", mission, "--listen", listen, "--web", 0) as child:
        address = child.stderr.readline().removeprefix("the run is shown at ").strip()
        with connect(f"ws{address.removeprefix('http')}ws", open_timeout=PATIENCE_S) as client:
            client.send('{"kind": "hello"}')
            told = [json.loads(one) for one in (client.recv(PATIENCE_S) for _ in range(4)) if isinstance(one, str)]
        scene, frame = told[0], next(one for one in told if one["kind"] == "frame")
        assert scene["mission"] == "Depot" and scene["truth"] is True and scene["may_act"] is False
        assert frame["line"] == "simulator: waiting for somebody to connect" and listen in frame["why"]
        assert [mover["name"] for mover in frame["movers"]] == ["forklift"]
        child.send_signal(signal.SIGTERM)
        assert child.wait(timeout=PATIENCE_S) == 0


def test_a_page_that_cannot_be_served_is_told_before_anything_else(tmp_path: Path) -> None:
    mission = Path(__file__).resolve().parents[2] / "missions" / "open.toml"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        for options, says in (
            (["--web", place], f"--web {place}: Address already in use; choose another one"),
            (["--web", "0.0.0.0:0"], "name a file for it with --web-token FILE"),
            (["--web-token", tmp_path / "token"], "add --web PORT"),
        ):
            result = CliRunner().invoke(app, ["serve", str(mission), *map(str, options)])
            assert result.exit_code == 2 and says in result.stderr and result.stderr.count("\n") == 1
