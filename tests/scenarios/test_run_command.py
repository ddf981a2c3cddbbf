"""``rover-companion run`` as people meet it: what it says, how it ends, and what the rover does then."""

from __future__ import annotations

import signal
import socket
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.core.frames import NedPoint
from companion.mapping.map_files import load_map
from companion.mission.load import load_mission
from companion.recording.reader import load_record
from companion.replay.replay import replay
from companion.safety.reasons import EndReason
from tests.support.quick import first_of
from tests.support.rig import ARM, GUIDED, HOLD, MANUAL, SET_MODE, yard
from tests.support.served import PATIENCE_S, Stopwatch, finished, mission_path, process, served, wait_until

SIMULATED = """
[[target]]
north_m = 3.0
east_m = 0.0
[sitl]
world = "none.png"
sensors = "none.toml"
parameters = "none.param"
"""
"""A mission that has come to a rover without the simulator's files."""


def assert_one_line(text: str) -> None:
    assert len(text.strip().splitlines()) == 1 and "Traceback" not in text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mission": "none.toml"}, ["none.toml"]),
        ({"text": "[grid]\nresolution = 1.0\n"}, ["yard.toml", "resolution", "resolution_m"]),
        ({"text": "[[target\n"}, ["yard.toml", "TOML"]),
        ({"settings": "[safety]\nstale = 2.0\n"}, ["settings.toml", "safety.stale", "stale_s"]),
        ({"settings": "[safety]\nstale_s = -2.0\n"}, ["settings.toml", "safety.stale_s", "more than 0", "-2.0"]),
        ({"connect": "bluetooth:1"}, ["bluetooth:1", "udpin:HOST:PORT"]),
        ({"connect": "udpin:127.0.0.1:no"}, ["'no' is not a port"]),
        ({"text": SIMULATED, "connect": "udpin:127.0.0.1:no"}, ["'no' is not a port"]),
        ({"connect": "tcp:no.such.host.invalid:5760"}, ["no.such.host.invalid", "check the name"]),
        ({"connect": "serial:/dev/none:57600"}, ["/dev/none"]),
        ({"record": "yard.toml/record"}, ["yard.toml/record", "cannot record here", "choose"]),
        ({"record": "yard.toml"}, ["yard.toml: is a file, no directory; choose a directory"]),
    ],
    ids=[
        "mission",
        "mission key",
        "not toml",
        "settings key",
        "value",
        "link",
        "port",
        "simulator's files",
        "host",
        "device",
        "record",
        "record is a file",
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path: Path, change: dict[str, str], said: list[str]) -> None:
    path = mission_path(yard(tmp_path))
    if "text" in change:
        path.write_text(change["text"])
    arguments = [
        "run",
        str(tmp_path / change.get("mission", path.name)),
        "--connect",
        change.get("connect", "tcp:127.0.0.1:9"),
    ]
    if "settings" in change:
        (tmp_path / "settings.toml").write_text(change["settings"])
        arguments += ["--settings", str(tmp_path / "settings.toml")]
    if "record" in change:
        arguments += ["--record", str(tmp_path / change["record"])]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2, result.output
    assert_one_line(result.stderr)
    assert all(word in result.stderr for word in said), result.stderr


@pytest.mark.parametrize(("scheme", "kind"), [("udpin", socket.SOCK_DGRAM), ("tcpin", socket.SOCK_STREAM)])
def test_a_port_in_use_is_one_line_and_exit_code_2(tmp_path: Path, scheme: str, kind: int) -> None:
    path = mission_path(yard(tmp_path))
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            taken.listen()
        port = taken.getsockname()[1]
        result = CliRunner().invoke(app, ["run", str(path), "--connect", f"{scheme}:127.0.0.1:{port}"])
    assert result.exit_code == 2
    assert_one_line(result.stderr)
    assert str(port) in result.stderr and "stop the other program" in result.stderr


@pytest.mark.thorough
def test_a_peer_that_is_not_there_is_waited_for_until_ctrl_c(tmp_path: Path) -> None:
    path = mission_path(yard(tmp_path))
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound, not listening: connections are refused
        url = f"tcp:127.0.0.1:{closed.getsockname()[1]}"
        with process("companion", "run", path, "--connect", url) as run:
            line = run.stderr.readline()
            while "waiting" not in line:
                assert line
                line = run.stderr.readline()
            assert url in line and "not connected" in line
            time.sleep(1.0)
            assert run.poll() is None
            run.send_signal(signal.SIGINT)
            with Stopwatch() as watch:
                code, out, err = finished(run)
    assert watch.quiet_s < 2.0
    assert code == 130
    assert out == "gate: pending\n", "nothing is there to go on with"
    assert "Traceback" not in err


@first_of(1, "number", [signal.SIGTERM, signal.SIGINT, pytest.param(signal.SIGHUP, marks=pytest.mark.thorough)])
@pytest.mark.slow
def test_a_signal_while_driving_stops_the_rover(tmp_path: Path, number: signal.Signals) -> None:
    mission = yard(tmp_path)
    record = tmp_path / "record"
    with (
        served(mission) as world,
        process("companion", "run", mission_path(mission), "--connect", world.url, "--arm", "--record", record) as run,
    ):
        wait_until(lambda: world.simulator.truth.speed_m_s > 1.0)
        run.send_signal(number)
        with Stopwatch() as watch:
            code, out, err = finished(run)
        assert watch.quiet_s < 2.0
        assert world.mode() == HOLD
        wait_until(lambda: world.simulator.truth.speed_m_s < 0.05)
        driven_m = world.simulator.driven_m
        time.sleep(2.0)
        assert world.simulator.driven_m - driven_m < 0.05
        assert world.simulator.collisions == ()
    assert code == 130
    assert "gate: pending" in out and "Traceback" not in err
    assert "the rover was left armed, in HOLD" in err.splitlines()
    seen = load_map(record / "map.yaml")  # as far as it was seen, not the grid that was kept
    assert seen.contains(seen.cell_at(NedPoint(0.0, 0.0))) and 1 < seen.width < 24
    again = replay(load_record(record))
    assert again.differences == [] and again.companion is not None and again.companion.done
    end = again.companion.mission_run.end
    by_user = EndReason.STOPPED_BY_USER if number == signal.SIGINT else EndReason.TERMINATED
    assert end is not None and end.kind is load_record(record).meta.end_reason is by_user


@pytest.mark.slow
def test_a_companion_that_is_killed_leaves_the_rover_on_ground_it_had_seen(tmp_path: Path) -> None:
    mission, record = yard(tmp_path), tmp_path / "record"
    with (
        served(mission) as world,
        process("companion", "run", mission_path(mission), "--connect", world.url, "--arm", "--record", record) as run,
    ):
        wait_until(lambda: world.simulator.driven_m > 2.0)
        run.kill()
        finished(run)
        time.sleep(1.0)
        wait_until(lambda: world.simulator.truth.speed_m_s < 0.05)
        time.sleep(1.0)
        assert world.simulator.truth.speed_m_s < 0.05
        assert world.simulator.collisions == ()
    cut = load_record(record)
    again = replay(cut)
    assert again.differences == [] and again.decisions > 0
    assert len(cut.notes) == 1 and "was not closed" in cut.notes[0]


@pytest.mark.slow
def test_the_pilot_wins_and_the_autopilot_is_quoted(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    with served(mission) as world, process("companion", "run", mission_path(mission), "--connect", world.url) as run:
        lines = iter(run.stderr.readline, "")
        assert any("a person to arm" in line for line in lines)
        world.pilot(ARM, 1)
        wait_until(lambda: world.simulator.driven_m > 1.0)
        world.pilot(SET_MODE, 1, MANUAL)
        assert any("mode is not GUIDED" in line for line in lines)
        time.sleep(2.0)
        assert world.mode() == MANUAL
        world.pilot(SET_MODE, 1, GUIDED)
        code, out, _ = finished(run)
        assert world.simulator.collisions == ()
    assert (code, out) == (0, "gate: reached\n")


def walled_in(folder: Path) -> Path:
    """A mission whose only target is known to be unreachable from the start."""
    path = mission_path(yard(folder, sealed=True))
    path.write_text(path.read_text().replace('name = "Yard"', 'name = "Yard"\nprior_map = "yard.png"', 1))
    return path


def test_a_target_that_the_prior_map_shows_walled_in_is_missed_with_exit_code_3(tmp_path: Path) -> None:
    path, record = walled_in(tmp_path), tmp_path / "record"
    with (
        served(load_mission(path)) as world,
        process("companion", "run", path, "--connect", world.url, "--arm", "--record", record) as run,
    ):
        code, out, err = finished(run)
        assert world.simulator.driven_m < 1.0, "it knew"
    assert code == 3, err
    assert "gate: unreachable" in out and "Traceback" not in err
    assert load_map(record / "map.yaml").weights[9, 13] >= 1.0


def test_whoever_reads_its_messages_may_go_away(tmp_path: Path) -> None:
    path = walled_in(tmp_path)
    with (
        served(load_mission(path)) as world,
        process("companion", "run", path, "--connect", world.url, "--arm") as run,
    ):
        assert "waiting" in run.stderr.readline()
        run.stderr.close()
        assert run.stdout.read() == "gate: unreachable\n"
        assert run.wait(timeout=PATIENCE_S) == 3


def test_a_mission_that_cannot_be_laid_out_ends_before_anybody_arms(tmp_path: Path) -> None:
    """Only on the spot it turns out that the rover begins within a fence."""
    path = mission_path(yard(tmp_path))
    path.write_text(path.read_text() + "[[keep_out]]\nnorth_m = 0.0\neast_m = 0.0\nradius_m = 2.0\n")
    with served(load_mission(path)) as world:
        with process("companion", "run", path, "--connect", world.url, "--arm") as run:
            code, out, err = finished(run)
        assert not any(m.base_mode & 128 for m in world.heard() if m.get_type() == "HEARTBEAT")
    assert (code, out) == (2, "")
    assert "yard.toml: home" in err.splitlines()[-1] and "keep_out 1" in err and "Traceback" not in err
