"""``--view`` of the simulator's commands: the terminal that it needs, and that it is given back."""

import signal
from pathlib import Path

import pytest
from typer.testing import CliRunner

from sitl.cli.commands import app
from tests.sitl.network.test_server import free_port
from tests.support.pseudo_terminal import ended, on_a_terminal
from tests.support.quick import first_of

MISSION = "[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n"


@pytest.mark.parametrize("command", ["drive", "serve"])
def test_without_a_terminal_there_is_one_line(tmp_path: Path, command: str) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    result = CliRunner().invoke(app, [command, str(mission), "--view"])
    assert result.exit_code == 2 and result.output.count("\n") == 1 and "not a terminal" in result.output


def test_serving_gives_the_terminal_back_and_needs_no_colours(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    listen = f"tcp:127.0.0.1:{free_port()}"
    with on_a_terminal("sitl", "serve", mission, "--view", "--listen", listen, NO_COLOR="1") as drawn:
        assert drawn.read_until(b"disarmed")
        assert ended(drawn, signal.SIGINT) == 0
    assert b"stopped after" in drawn.last
    assert b"\x1b[38;" not in drawn.written and b"\x1b[48;" not in drawn.written


@pytest.mark.thorough
@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_driving_gives_the_terminal_back_when_it_is_ended(tmp_path: Path, number: signal.Signals, word: str) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION.replace("20, 20", "2000, 20").replace("9, 9", "1990, 9"))
    with on_a_terminal("sitl", "drive", mission, "--view") as drawn:
        assert drawn.read_until(b"GUIDED")
        assert ended(drawn, number) == 130
    assert f"stopped by {word}".encode() in drawn.last and b"Traceback" not in drawn.written


@first_of(1, ("columns", "rows"), [(40, 10), (80, 24)])
def test_the_last_picture_of_a_drive_stays_on_the_terminal_and_under_it_the_outcome(
    tmp_path: Path, columns: int, rows: int
) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    size = {"COLUMNS": str(columns), "LINES": str(rows)}
    image = tmp_path / "p.png"
    with on_a_terminal("sitl", "drive", mission, "--view", "--speedup", "1000", "--image", image, **size) as drawn:
        assert ended(drawn) == 0
    last = [line.strip() for line in drawn.last.decode().split("\r\n")]
    shown = last[-rows:]
    assert any("outcome: reached, 1 of 1" in line for line in shown[-6:]) and "picture:" in " ".join(shown[-4:])
    assert columns < 60 or any("✓ reached" in line for line in shown)


def test_the_help_of_drive_says_how_fast_it_is_with_a_page() -> None:
    told = CliRunner().invoke(app, ["drive", "--help"], env={"COLUMNS": "300"}).output
    assert "as fast as possible, with --view 10, with --web 1." in told
