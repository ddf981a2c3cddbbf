"""``rover-companion run --view``: the picture of a run on a terminal, and that it never holds up the drive."""

from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path

import pytest

from companion.mission.mission import Mission
from tests.support.forked import run
from tests.support.pseudo_terminal import LEAVE, ended, on_a_terminal
from tests.support.rig import HOLD, yard
from tests.support.served import PATIENT, mission_path, served, wait_until


def arguments(folder: Path, mission: Mission, url: str) -> list[object]:
    (folder / "patient.toml").write_text(PATIENT)
    state = ("--state", folder / "state", "--settings", folder / "patient.toml")
    return ["run", mission_path(mission), "--connect", url, "--arm", "--view", *state]


@pytest.fixture
def nobody() -> str:
    """Where nobody listens."""
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        return f"tcp:127.0.0.1:{closed.getsockname()[1]}"


@pytest.mark.parametrize(
    ("number", "why"), [(signal.SIGINT, "stopped by the user"), (signal.SIGTERM, "told to end by a signal")]
)
def test_the_terminal_is_given_back_with_the_last_picture(
    tmp_path: Path, nobody: str, number: signal.Signals, why: str
) -> None:
    with on_a_terminal("companion", *arguments(tmp_path, yard(tmp_path), nobody)) as drawn:
        assert drawn.read_until(b"the autopilot's heartbeat")
        assert ended(drawn, number) == 130
    text = drawn.last.decode()
    assert text.index(why) < text.index("gate: pending") and "Traceback" not in text


def test_without_a_terminal_the_run_is_told_in_lines(tmp_path: Path) -> None:
    code, out, err = run("companion", *arguments(tmp_path, yard(tmp_path), "tcp:127.0.0.1:no"))
    assert (code, out) == (2, "")
    first, last = err.splitlines()
    assert "--view: standard error is not a terminal" in first and "in lines" in first and "not a port" in last


@pytest.mark.slow
def test_a_terminal_that_nobody_reads_holds_up_nothing(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    with (
        served(mission) as world,
        on_a_terminal("companion", *arguments(tmp_path, mission, world.url)) as drawn,
    ):
        assert drawn.read_until(b"driving to gate")
        begun_m = world.simulator.driven_m
        os.write(drawn.ours, b"\x13")  # Ctrl-S: the terminal takes nothing more, and nobody reads it
        wait_until(lambda: world.simulator.driven_m > begun_m + 2.0)
        assert world.simulator.truth.speed_m_s > 0.5
        began_s = time.monotonic()
        drawn.child.send_signal(signal.SIGTERM)
        assert drawn.child.wait(timeout=60.0) == 130
        assert time.monotonic() - began_s < 10.0
        drawn.read_until()
        assert LEAVE not in drawn.written, "it was stuck to the end"
        assert world.mode() == HOLD and world.simulator.collisions == ()
