"""docs/first-drive.md: its table is the code's, its missions drive, and its bench step happens as it says."""

from __future__ import annotations

import re
import runpy
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from tests.docs.test_docs import APPS, ROOT, blocks
from tests.support.quick import first_of
from tests.support.rig import ARM, ARMED, GUIDED, HOLD, SET_MODE
from tests.support.served import Served, process, wait_until

PAGE = ROOT / "docs" / "first-drive.md"
PORT = "serial:/dev/ttyACM0:115200"
STEPS = ("five-metres", "post", "gate", "yard")


def commands() -> list[list[str]]:
    """Every command of the page, in its order."""
    lines = [line for where, block in blocks("sh") if where.startswith(PAGE.name) for line in block.splitlines()]
    return [line.split() for line in lines if line]


def test_the_table_of_parameters_is_that_of_the_code() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_parameters.py"))["page"]()
    assert PAGE.read_text(encoding="utf-8") == made, "run .venv/bin/python docs/make_parameters.py"


def test_what_other_pages_say_of_parameters_is_in_the_table() -> None:
    table = PAGE.read_text(encoding="utf-8").split("<!-- end parameters -->")[0]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    safety = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8").split("## About the tables")[0]
    named = set(re.findall(r"`([A-Z][A-Z0-9]*_[A-Z0-9_]+)`", readme + safety))
    assert {"WP_JERK", "OA_TYPE", "WP_SPEED", "FS_GCS_ENABLE"} <= named
    assert named - set(re.findall(r"^\| `([A-Z0-9_]+)`", table, re.MULTILINE)) <= {"OBSTACLE_DISTANCE"}


def test_each_step_says_what_to_do_to_watch_what_must_happen_and_when_to_stop() -> None:
    text = PAGE.read_text(encoding="utf-8")
    steps = re.split(r"^## Step \d", text, flags=re.MULTILINE)[1:]
    assert len(steps) == 5
    for step in steps:
        assert re.findall(r"^\| (do|watch|must happen|stop when) \|", step, re.MULTILINE) == [
            "do", "watch", "must happen", "stop when",
        ], step[:40]  # fmt: skip
        assert "rover-companion run missions/first-drive/" in step


def test_commands_at_the_desk_work_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that need no rover; drives are another test."""
    monkeypatch.chdir(tmp_path)
    done = []
    for words in commands():
        if words[1] in ("missions", "mission") or "--write" in words:
            result = CliRunner().invoke(APPS[words[0]], words[1:])
            assert result.exit_code == 0, f"{' '.join(words)}: {result.output}"
            done.append(words[1])
    assert done == ["missions", "mission", "params"]
    assert "\nWP_SPEED,0.5\n" in (tmp_path / "rover.param").read_text()
    named = {word for words in commands() for word in words if word.startswith("missions/")}
    assert named == {f"missions/first-drive/{step}.toml" for step in STEPS}
    assert all(load_mission(tmp_path / name).targets for name in named)


@pytest.mark.parametrize("sensors", ["lidar-360", pytest.param("lidar-90", marks=pytest.mark.thorough)])
@first_of(1, "step", STEPS)
def test_each_mission_is_driven_in_the_simulator(step: str, sensors: str) -> None:
    mission = load_mission(ROOT / "missions" / "first-drive" / f"{step}.toml")
    scenario = replace(scenario_from_mission(mission), sensors=sensors)
    drive = Drive(mission, scenario, Settings(), 0, NullRecorder(), 150.0)
    assert drive.run().exit_code == 0


@pytest.mark.slow
def test_the_bench_step_happens_as_it_says(tmp_path: Path) -> None:
    """Its own command, with the simulated rover at the port: a person arms, sets HOLD and ends the run."""
    (bench,) = (words for words in commands() if words[-1] == "records/bench")
    shutil.copytree(ROOT / "missions", tmp_path / "missions")
    rover = Served(load_mission(tmp_path / bench[2]))
    try:
        words = [rover.url if word == PORT else word for word in bench[1:]]
        words = [str(tmp_path / word) if word.startswith(("missions/", "records/")) else word for word in words]
        with process("companion", *words) as run:
            wait_until(lambda: rover.mode() == GUIDED)
            rover.pilot(ARM, 1.0)
            said = ""
            while "Heading for five metres" not in said:
                said += run.stderr.readline()
            wait_until(lambda: rover.simulator.driven_m > 0.1)
            rover.pilot(SET_MODE, float(ARMED & 1 | 1), float(HOLD))
            while "Companion no longer steers: mode is not GUIDED; it waits for a person to set GUIDED" not in said:
                said += run.stderr.readline()
            assert rover.mode() == HOLD
    finally:
        rover.close()
