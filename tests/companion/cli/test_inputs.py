"""Outputs go nowhere where they would destroy something."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.inputs import OutputError, apart
from sitl.cli.commands import app

MISSION = """
[[target]]
north_m = 5.0
east_m = 0.0
[sitl]
world = "world.toml"
start = [2, 2]
"""


def test_an_output_is_no_input_and_no_other_output(tmp_path: Path) -> None:
    here, there = tmp_path / "a.png", tmp_path / "b.png"
    (tmp_path / "link.png").symlink_to(here)
    apart((here, None, there), (None, tmp_path / "c.toml"))
    for outputs, inputs in (((here, here), ()), ((here,), (here,)), ((tmp_path / "link.png",), (here,))):
        with pytest.raises(OutputError, match="choose another name"):
            apart(outputs, inputs)


@pytest.mark.parametrize("file", ["mission.toml", "world.toml"])
@pytest.mark.parametrize("command", [("drive", "--json"), ("physics", "--write-params")])
def test_commands_do_not_write_over_what_they_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, str], file: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mission.toml").write_text(MISSION)
    Path("world.toml").write_text("size_m = [20.0, 20.0]\n")
    before = Path(file).read_bytes()
    result = CliRunner().invoke(app, [command[0], "mission.toml", command[1], file])
    assert result.exit_code == 2 and f"{file}: is another file of this command" in result.output
    assert Path(file).read_bytes() == before
