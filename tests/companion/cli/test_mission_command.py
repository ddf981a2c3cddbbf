"""``rover-companion mission check``."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


SHIPPED = sorted(path for path in MISSIONS.iterdir() if path.suffix in (".toml", ".plan", ".waypoints"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_mission_is_understood(path: Path) -> None:
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 0
    assert "grid:" in result.output and "rover: radius" in result.output


def test_it_says_what_was_understood(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        'name = "[bold]yard[/bold]"\n[[target]]\nname = "gate"\nnorth_m = 5\neast_m = 2.5\n'
        'hold_s = 3\non_blocked = "wait"\n'
        "[[keep_out]]\nlat_deg = 53.0\nlon_deg = 23.0\nradius_m = 7\n"
        "[[keep_in]]\npolygon_m = [[-50, -50], [-50, 50], [50, 50]]\n"
        "[[corridor]]\nweight = 0.2\nline_m = [[0, 0], [5, 5]]\nwidth_m = 2\n"
    )
    output = CliRunner().invoke(app, ["mission", "check", str(path)]).output
    for text in (
        "[bold]yard[/bold]",
        "gate",
        "5 m north, 2.5 m east of home",
        "3 s",
        "wait",
        "keep out of a circle of 7 m round 53.0000000, 23.0000000",
        "keep inside a polygon of 3 corners",
        "weight 0.2 in a line 2 m wide",
    ):
        assert text in output


def test_a_bad_file_gets_one_line_and_exit_code_2(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nfeild = [1, 2]\n")
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2
    assert result.output == f"{path}: target 1.feild: unknown key, did you mean 'field'?\n"


def test_a_bad_world_is_found_too(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    (tmp_path / "w.png").write_bytes(b"nothing")
    path.write_text("[[target]]\nnorth_m = 5\neast_m = 2.5\n[sitl]\nworld = 'w.png'\n")
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2
    assert result.output.count("\n") == 1 and "w.png: header" in result.output


@pytest.mark.parametrize(
    ("north_m", "reason"), [(30.0, "target 1 'target 1': lies in"), (30000.0, "are more than 4000000")]
)
def test_a_mission_that_could_never_begin_is_refused(tmp_path: Path, north_m: float, reason: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        f"[[target]]\nnorth_m = {north_m}\neast_m = 0\n[[keep_out]]\nnorth_m = 30\neast_m = 0\nradius_m = 4\n"
    )
    result = CliRunner().invoke(app, ["mission", "check", str(path)])
    assert result.exit_code == 2 and result.output.count("\n") == 1
    assert str(path) in result.output and reason in result.output
