"""A fence and a battery, with the companion as a process of its own that talks over TCP."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.support.rig import HOLD, yard
from tests.support.served import finished, mission_path, process, served, wait_until

GATE = '[[target]]\nname = "gate"\nfield = [15, 7]\n'


def test_a_target_outside_the_autopilots_fence_ends_the_run_before_it_begins(tmp_path: Path) -> None:
    (tmp_path / "rover.param").write_text("FENCE_ENABLE 1\nFENCE_TYPE 2\nFENCE_RADIUS 10\nFENCE_MARGIN 1\n")
    mission = yard(tmp_path, 'parameters = "rover.param"\n' + GATE)
    with (
        served(mission) as rover,
        process("companion", "run", mission_path(mission), "--connect", rover.url, "--arm") as run,
    ):
        code, out, err = finished(run)
        assert code == 2, (out, err)
        line = err.strip().splitlines()[-1]
        assert "yard.toml: target 1 'gate': lies outside" in line and "circle of 10 m round home" in line
        assert rover.simulator.driven_m == 0.0 and not rover.simulator._vehicle.armed


@pytest.mark.slow
def test_a_battery_that_runs_low_brings_the_rover_back_and_ends_the_run_with_exit_code_3(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    options = tmp_path / "settings.toml"
    options.write_text("[power]\nreturn_volts = 11.0\nafter_s = 0.5\n")
    arguments = ["run", mission_path(mission), "--connect", "", "--arm", "--settings", options]
    with served(mission) as rover:
        arguments[3] = rover.url
        with process("companion", *arguments) as run:
            wait_until(lambda: rover.simulator.driven_m > 3.0)
            rover.simulator._vehicle.battery.fault_v = 10.8
            code, out, err = finished(run)
            assert code == 3, (out, err)
            assert "gate: skipped (battery at 10." in out
            assert "Returning: battery at 10." in err
            truth, start = rover.simulator.truth, rover.simulator._start
            assert math.hypot(truth.north_m - start.north_m, truth.east_m - start.east_m) < 1.5
            assert rover.mode() == HOLD
