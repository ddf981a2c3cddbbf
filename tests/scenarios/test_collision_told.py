"""A collision is told wherever a run is looked at: its place, its time, how fast, and with what."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from companion.cli.commands import app as companion
from companion.recording.contacts import contacts_of
from sitl.cli.commands import app
from tests.support.reports import report_data_in

WORLD = """
size_m = [30.0, 20.0]
[[obstacle]]
line_m = [[8.0, 14.0], [14.0, 14.0]]
width_m = 0.3
material = "glass"
"""
MISSION = """
name = "Glass"
[[target]]
north_m = 0.0
east_m = 16.0
[sitl]
world = "world.toml"
start = [5, 10]
"""


@pytest.mark.thorough
def test_in_lines_table_figures_record_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("world.toml").write_text(WORLD)
    Path("glass.toml").write_text(MISSION)
    command = [
        "drive",
        "glass.toml",
        "--time-limit-s",
        "60",
        "--json",
        "figures.json",
        "--record",
        "run",
        "--image",
        "glass.png",
        "--report",
        "glass.html",
    ]
    result = CliRunner().invoke(app, command, env={"COLUMNS": "160"})
    assert result.exit_code == 4
    (contact,) = json.loads(Path("figures.json").read_text())["contacts"]
    assert contact["with"] == "an obstacle" and 0.5 < contact["speed_m_s"] < 2.0
    assert contact["east_m"] == pytest.approx(14.0 - 5.5 - 0.15 - 0.35, abs=0.1)
    assert contact["north_m"] == pytest.approx(0.0, abs=0.3)
    assert json.loads(Path("run/collisions.json").read_text()) == [contact]
    (starred,) = report_data_in(Path("glass.html"))["contacts"]
    assert starred["what"] == "an obstacle" and starred["speed"] == contact["speed_m_s"]
    replayed = CliRunner().invoke(companion, ["replay", "run"])
    told = f"collision at {contact['time_s']} s of the simulation: an obstacle, {contact['speed_m_s']} m/s"
    assert replayed.exit_code == 0 and told in replayed.output
    for text in ("[1]", "{}", '[{"time_s": "x", "north_m": 0, "east_m": 0, "speed_m_s": 0, "with": 3}]'):
        Path("run/collisions.json").write_text(text)
        with pytest.raises(ValueError, match="validation error"):
            contacts_of(Path("run"))
    assert "collisions.json: cannot be read" in CliRunner().invoke(companion, ["replay", "run"]).output
    line = (
        f"collision 1: the rover, driving {contact['speed_m_s']:.1f} m/s, touched an obstacle "
        f"at {contact['time_s']:.1f} s"
    )
    assert line in result.output
    assert f"{contact['time_s']} s: an obstacle, {contact['speed_m_s']} m/s" in result.output
    pixels = np.array(Image.open("glass.png").convert("RGB"))
    assert (pixels == (255, 0, 0)).all(axis=2).sum() > 100, "the red cross"
