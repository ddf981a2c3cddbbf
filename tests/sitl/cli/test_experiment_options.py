"""Options of ``rover-sitl experiment`` that cannot be used: one line and exit code 2, before the work."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from sitl.cli.commands import app


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
@pytest.mark.parametrize("option", ["--planners", "--controllers", "--setups", "--missions"])
def test_a_list_that_names_nothing_does_not_mean_all(option: str, listed: str) -> None:
    said = refused("soak", "--runs", "1", option, listed)
    assert said == f"{option} {listed!r}: names nothing; separate names by commas\n"


def test_an_empty_outline_is_none() -> None:
    assert refused("gates", "--outline", "").startswith("--outline '': give length and width")
