"""``rover-companion run --resume`` as a process, killed and stopped while it drives a rover on a TCP port."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.checkpoint.state_format import SavedProgress, decode_state, encode_state
from companion.cli.commands import app
from companion.mission.identity import fingerprint
from companion.recording.reader import load_record
from companion.replay.replay import replay
from tests.support.rig import GATE, HOLD, yard
from tests.support.served import Stopwatch, finished, mission_path, process, served, wait_until
from tests.support.states import a_state

TWO = GATE + 'hold_s = 0.5\n[[target]]\nname = "corner"\nfield = [4, 3]\n'


@pytest.mark.slow
def test_killed_at_random_times_the_mission_is_driven_to_its_end(tmp_path: Path) -> None:
    mission = yard(tmp_path, TWO)
    run_it = ("run", mission_path(mission), "--arm", "--state", tmp_path / "state", "--connect")
    rng = np.random.default_rng(1)
    said = ""
    with served(mission) as world:
        for number in range(3):
            more = ("--resume",) if number else ()
            with process("companion", *run_it, world.url, *more) as run:
                if number == 2:
                    code, out, err = finished(run)
                    break
                goal_m = world.simulator.driven_m + float(rng.uniform(1.0, 7.0))
                wait_until(lambda goal_m=goal_m: world.simulator.driven_m > goal_m)
                run.kill()
                said += finished(run)[2]
        assert world.simulator.collisions == ()
    assert (code, out) == (0, "gate: reached\ncorner: reached\n"), err
    assert (said + err).count("Reached gate") == 1
    assert "Resumed with its map" in err and "Traceback" not in said + err


@pytest.mark.slow
def test_sigterm_stops_the_rover_saves_and_is_gone_within_a_second(tmp_path: Path) -> None:
    """One more second for this machine, and as much more as it is slower than a quiet one."""
    mission = yard(tmp_path, TWO)
    run_it = ("run", mission_path(mission), "--arm", "--state", tmp_path / "state")
    with served(mission) as world:
        with process("companion", *run_it, "--connect", world.url) as run:
            wait_until(lambda: world.simulator.driven_m > 5.0)
            run.send_signal(signal.SIGTERM)
            with Stopwatch() as watch:
                code, _, err = finished(run)
        assert code == 130 and watch.quiet_s < 2.0, err
        assert world.mode() == HOLD
        state, rasters = decode_state((tmp_path / "state" / "mission.state").read_bytes())
        assert state.released and not state.ended and rasters["log_odds"].any()
        with process("companion", *run_it, "--connect", world.url, "--resume") as run:
            assert any("Resumed with its map" in line for line in iter(run.stderr.readline, ""))
            run.send_signal(signal.SIGTERM)
            assert finished(run)[0] == 130


HANGING = """
import os, sys, time
synced = os.fsync
def hang(handle):
    while os.path.exists({flag!r}):
        time.sleep(0.05)
    return synced(handle)
os.fsync = hang
"""


@pytest.mark.slow
def test_sigterm_is_obeyed_within_a_second_by_a_run_whose_disk_hangs(tmp_path: Path) -> None:
    """One more second for this machine, and as much more as it is slower than a quiet one."""
    mission = yard(tmp_path, TWO)
    flag = tmp_path / "hangs"
    kept = ("--state", tmp_path / "state", "--record", tmp_path / "record")
    with served(mission) as world:
        command = ("run", mission_path(mission), "--arm", "--connect", world.url, *kept)
        with process("companion", *command, first=HANGING.format(flag=str(flag))) as run:
            wait_until(lambda: world.simulator.driven_m > 3.0)
            flag.touch()
            wait_until(lambda: world.simulator.driven_m > 5.0)
            run.send_signal(signal.SIGTERM)
            with Stopwatch() as watch:
                code, _, err = finished(run)
        assert code == 130 and watch.quiet_s < 2.0, (watch.quiet_s, err)
        assert world.mode() == HOLD
    assert err.count("the disk does not answer") == 3 and "Traceback" not in err  # state, map, record
    cut = load_record(tmp_path / "record")
    assert not cut.complete and replay(cut).differences == []


@pytest.mark.parametrize(
    ("fault", "code", "said"),
    [
        (
            "another mission",
            2,
            r"mission\.state: of another mission \('Yard', 1 of 1 targets reached\); resume that one",
        ),
        (
            "damaged",
            2,
            r"mission\.state: damaged \(wrong checksum\); kept as mission\.state\.damaged; the next start",
        ),
        ("ended", 0, "Yard was driven to its end: 1 of 1 targets reached"),
    ],
)
def test_a_state_that_cannot_be_taken_up_is_told_before_anything_is_connected(
    tmp_path: Path, fault: str, code: int, said: str
) -> None:
    mission = yard(tmp_path)
    values = {**a_state().progress.model_dump(), "statuses": ["reached"], "phase": "done", "index": 1}
    state = a_state(mission_sha256=fingerprint(mission), ended=True, progress=SavedProgress.model_validate(values))
    data = encode_state(state, {})
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "mission.state").write_bytes(data[:-50] if fault == "damaged" else data)
    if fault == "another mission":
        mission_path(mission).write_text(mission_path(mission).read_text().replace("[15, 7]", "[16, 7]"))
    arguments = [
        "run",
        mission_path(mission),
        "--connect",
        "tcp:127.0.0.1:9",
        "--state",
        tmp_path / "state",
        "--resume",
    ]
    result = CliRunner().invoke(app, [str(word) for word in arguments])
    assert result.exit_code == code
    assert result.stdout == ("gate: reached\n" if code == 0 else "")
    assert len(result.stderr.splitlines()) == (2 if code == 0 else 1) and re.search(said, result.stderr)
