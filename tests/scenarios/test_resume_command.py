"""``rover-companion run --resume`` as a process of its own, killed and stopped while it drives a rover on a TCP port."""

from __future__ import annotations

import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from companion.state.format import decoded
from tests.rig import GATE, HOLD, yard
from tests.served import finished, mission_path, process, served, wait_until

TWO = GATE + 'hold_s = 0.5\n[[target]]\nname = "corner"\nfield = [4, 3]\n'


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_killed_at_random_times_the_mission_is_driven_to_its_end(tmp_path: Path, seed: int) -> None:
    mission = yard(tmp_path, TWO)
    run_it = ("run", mission_path(mission), "--arm", "--state", tmp_path / "state", "--connect")
    rng = np.random.default_rng(seed)
    said = ""
    with served(mission) as world:
        for number in range(3):
            more = ("--resume",) if number else ()
            with process("companion", *run_it, world.url, *more) as run:
                if number == 2:
                    code, out, err = finished(run, 90.0)
                    break
                goal_m = world.simulator.driven_m + float(rng.uniform(1.0, 7.0))
                wait_until(lambda goal_m=goal_m: world.simulator.driven_m > goal_m, 60.0)
                run.kill()
                said += finished(run, 5.0)[2]
        assert world.simulator.collisions == ()
    assert (code, out) == (0, "gate: reached\ncorner: reached\n"), err
    assert (said + err).count("Reached gate") == 1
    assert "Resumed with its map" in err and "Traceback" not in said + err


def test_sigterm_stops_the_rover_saves_and_is_gone_within_a_second(tmp_path: Path) -> None:
    """A second, and one more for this machine, which does other things as well."""
    mission = yard(tmp_path, TWO)
    run_it = ("run", mission_path(mission), "--arm", "--state", tmp_path / "state")
    with served(mission) as world:
        with process("companion", *run_it, "--connect", world.url) as run:
            wait_until(lambda: world.simulator.driven_m > 5.0, 60.0)
            run.send_signal(signal.SIGTERM)
            began_s = time.monotonic()
            code, _, err = finished(run, 10.0)
            took_s = time.monotonic() - began_s
        assert code == 130 and took_s < 2.0, err
        assert world.mode() == HOLD
        state, rasters = decoded((tmp_path / "state" / "mission.state").read_bytes())
        assert state.released and not state.ended and rasters["log_odds"].any()
        with process("companion", *run_it, "--connect", world.url, "--resume") as run:
            assert run.stderr is not None
            assert any("Resumed with its map" in line for line in iter(run.stderr.readline, ""))
            run.send_signal(signal.SIGTERM)
            assert finished(run, 10.0)[0] == 130


@pytest.mark.parametrize("fault", ["another mission", "damaged", "ended"])
def test_a_state_that_cannot_be_taken_up_is_told_in_a_line(tmp_path: Path, fault: str) -> None:
    mission = yard(tmp_path)
    run_it = ("run", mission_path(mission), "--arm", "--state", tmp_path / "state")
    with served(mission) as world:
        with process("companion", *run_it, "--connect", world.url) as run:
            wait_until(lambda: world.simulator.driven_m > 1.0, 60.0)
            if fault == "ended":
                assert finished(run, 60.0)[0] == 0
            run.kill()
            finished(run, 10.0)
        file = tmp_path / "state" / "mission.state"
        if fault == "another mission":
            mission_path(mission).write_text(mission_path(mission).read_text().replace("[15, 7]", "[16, 7]"))
        elif fault == "damaged":
            file.write_bytes(file.read_bytes()[:-100])
        with process("companion", *run_it, "--connect", world.url, "--resume") as run:
            code, out, err = finished(run, 60.0)
    if fault == "ended":
        assert (code, out) == (0, "gate: reached\n") and "was driven to its end: 1 of 1 targets reached" in err
        return
    assert (code, out) == (2, "") and len(err.splitlines()) == 1
    assert str(file) in err
    assert re.search("of another mission" if fault == "another mission" else "kept as mission.state.damaged", err)
