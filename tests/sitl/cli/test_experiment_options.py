"""Options of ``rover-sitl experiment`` that cannot be used: one line and exit code 2, before the work."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from sitl.cli.commands import app
from sitl.cli.experiment_options import EXPERIMENTS
from sitl.experiments import gates

WITHOUT_MAPS = ("gates", "barn", "controllers", "soak", "wang-table4", "achour-table1")


def refused(*arguments: str) -> str:
    """What is said on the one line."""
    result = CliRunner().invoke(app, ["experiment", *arguments])
    assert result.exit_code == 2 and result.output.count("\n") == 1, result.output
    return result.output


@pytest.mark.parametrize(("place", "reason"), [("file", "File exists"), ("file/kept", "Not a directory")])
def test_a_folder_that_cannot_keep_results_is_told_before_the_work(tmp_path: Path, place: str, reason: str) -> None:
    (tmp_path / "file").touch()
    keep = tmp_path / place
    said = refused("gates", "--runs", "1", "--keep", str(keep))
    assert said.startswith(f"--keep {keep}: cannot be written: {reason}; ")


@pytest.mark.parametrize(("runs", "bound"), [("0", "greater than or equal to 1"), ("1000001", "equal to 1000000")])
def test_there_are_no_more_runs_than_in_a_campaign(runs: str, bound: str) -> None:
    result = CliRunner().invoke(app, ["experiment", "moon", "--runs", runs])
    assert result.exit_code == 2 and bound in " ".join(result.output.split()), result.output


@pytest.mark.parametrize("listed", ["", " , "])
@pytest.mark.parametrize("option", ["--planners", "--controllers", "--setups", "--missions", "--sensors"])
def test_a_list_that_names_nothing_does_not_mean_all(option: str, listed: str) -> None:
    said = refused("soak", "--runs", "1", option, listed)
    assert said == f"{option} {listed!r}: names nothing; separate names by commas\n"


def test_an_empty_outline_is_none() -> None:
    assert refused("gates", "--outline", "").startswith("--outline '': give length and width")


@pytest.mark.parametrize("model", ["LD19", ""])
def test_a_lidar_is_for_barn_alone(model: str) -> None:
    said = refused("gates", "--runs", "1", "--lidar", model)
    assert said == "--lidar: gates does not take it; the option is for barn\n"


@pytest.mark.parametrize("model", ["LD18", "", "LD19:max=5"])
def test_a_lidar_that_is_no_model_is_refused_before_the_work(model: str) -> None:
    said = refused("barn", "--runs", "1", "--setups", "strict,jackal", "--lidar", model)
    assert said.startswith(f"--lidar {model!r}: is no model; models are LD06, LD19, ")


@pytest.mark.parametrize("name", WITHOUT_MAPS)
def test_maps_that_an_experiment_does_not_read_are_refused(name: str, tmp_path: Path) -> None:
    said = refused(name, "--runs", "1", "--maps", str(tmp_path))
    assert said.startswith(f"--maps: {name} does not take it; the option is for ")


@pytest.mark.parametrize("name", [one for one in EXPERIMENTS if one not in WITHOUT_MAPS])
def test_maps_that_an_experiment_reads_are_looked_for(name: str, tmp_path: Path) -> None:
    assert str(tmp_path / "none") in refused(name, "--runs", "1", "--maps", str(tmp_path / "none"))


def test_with_a_turning_radius_no_maps_are_read(tmp_path: Path) -> None:
    said = refused("driving", "--runs", "1", "--turning-radius", "2", "--maps", str(tmp_path))
    assert said.startswith("--turning-radius: ") and said.endswith("leave out --maps\n")


@pytest.mark.parametrize(("columns", "whole"), [(None, True), ("80", False)])
def test_tables_are_whole_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch, columns: str | None, whole: bool
) -> None:
    drives = (gates.GateDrive(f"my_controllers:{'X' * 40}", 0.9, 30.0, 0, True, 0, 12.0),)
    monkeypatch.setattr(gates, "run", lambda options, advance: gates.GatesReport(options, drives))
    monkeypatch.delenv("COLUMNS", raising=False)
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    result = CliRunner().invoke(app, ["experiment", "gates", "--runs", "1"])
    assert result.exit_code == 0
    heads = next(line for line in result.stdout.splitlines() if "gate m" in line or "…" in line)
    assert all(head in heads for head in gates.HEAD) == whole and (drives[0].controller in result.stdout) == whole


def test_ctrl_c_says_that_what_is_kept_is_not_lost(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(gates, "run", stopped)
    result = CliRunner().invoke(app, ["experiment", "gates", "--keep", str(tmp_path)])
    assert result.exit_code == 130
    assert f"what is done is kept in {tmp_path}; the same command goes on" in result.output
