"""``rover-sitl missions``: the shipped missions are found, listed and copied, and the wheel holds all of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.mission.load import load_mission
from sitl.cli import missions as command
from sitl.cli.commands import app

ROOT = Path(__file__).resolve().parents[3]


def test_each_listed_one_can_be_loaded() -> None:
    answer = CliRunner().invoke(app, ["missions"])
    names = [line.strip() for line in answer.output.splitlines()[1:-1]]
    assert answer.exit_code == 0 and {"rooms.toml", "first-drive/gate.toml", "field.plan", "field.waypoints"} <= set(
        names
    )
    assert "first-drive/gate-world.toml" not in names
    assert all(load_mission(ROOT / "missions" / name).targets for name in names)


def test_a_copy_is_complete_and_nothing_is_overwritten(tmp_path: Path) -> None:
    place = tmp_path / "mine"
    answer = CliRunner().invoke(app, ["missions", "--copy", str(place)])
    assert answer.exit_code == 0 and load_mission(place / "rooms.toml").targets
    again = CliRunner().invoke(app, ["missions", "--copy", str(place)])
    assert again.exit_code == 2 and again.output.count("\n") == 1 and "not there yet" in again.output


def test_nowhere_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "shipped", lambda: None)
    answer = CliRunner().invoke(app, ["missions"])
    assert answer.exit_code == 2 and answer.output.count("\n") == 1


def test_the_wheel_has_every_mission_and_what_they_name() -> None:
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["data-files"]
    packed = {file for patterns in table.values() for pattern in patterns for file in ROOT.glob(pattern)}
    for folder, patterns in table.items():
        inside = Path(folder).relative_to("share/rover-companion")
        assert all(Path(pattern).parent == inside for pattern in patterns), folder
    wanted = {file for file in (ROOT / "missions").rglob("*") if file.is_file() and "__pycache__" not in file.parts}
    assert wanted - packed == {ROOT / "missions" / "maps" / "draw.py"}
