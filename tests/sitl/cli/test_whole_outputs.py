"""Outputs for people: each takes the place of the old file when it is whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from companion.bench.measure import Entry, Limits
from companion.bench.page import write_page
from sitl.campaign.report import write_report
from sitl.campaign.tables import write_csv, write_parquet
from sitl.cli.commands import app
from sitl.experiments import drawing
from sitl.experiments.results_page import write_section
from sitl.search.found_file import write_find
from sitl.search.goals import Goal
from sitl.search.search import Find
from tests.sitl.campaign.test_run_store import RESULT, SPECS, TABLE

RUNS = [(SPECS[0], replace(RESULT, reached=0))]
"""Not complete: the report draws nothing."""
FIND = Find(Goal.STUCK, SPECS[0], (), {}, RESULT)
ENTRY = Entry("a", "rooms", 1, 1, 1, (1.0,), (1.0,), (), None)
OLD = "of before"


OUTPUTS: dict[str, Callable[[Path], object]] = {
    "found.toml": lambda file: write_find(FIND, SPECS[0], file, "rover-sitl campaign"),
    "runs.csv": lambda file: write_csv(file, RUNS),
    "runs.parquet": lambda file: write_parquet(file, RUNS),
    "report.html": lambda file: write_report(file, TABLE, RUNS, Path("c.toml")),
    "times.png": lambda file: drawing.save(Figure(), file),
    "results.md": lambda file: write_section(file.parent, "name", "text", file.name),
    "benchmarks.md": lambda file: write_page(file.parent, "bench", [ENTRY], [], [], Limits()),
    "images/benchmarks.png": lambda file: write_page(file.parents[1], "bench", [ENTRY], [], [], Limits()),
    "image.png": lambda file: world_made(file.parent, file),
}


def world_made(folder: Path, image: Path) -> None:
    """As the command makes it. Raises OSError where it says that a file cannot be written."""
    command = ["world", "make", "clutter", "--seed", "1", "--out", str(folder), "--image", str(image)]
    result = CliRunner().invoke(app, command)
    if result.exit_code:
        assert result.exit_code == 2 and "cannot be written" in result.output, result.output
        raise OSError


def fill_disk(file: Path, patch: pytest.MonkeyPatch) -> None:
    """The disk takes every file but this one, and says so at the end."""
    sync = os.fsync

    def full(handle: int) -> None:
        if os.readlink(f"/proc/self/fd/{handle}").endswith(f"/.{file.stem}.new{file.suffix}"):
            raise OSError(28, "No space left on device")
        sync(handle)

    patch.setattr(os, "fsync", full)


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_disk_that_is_full_leaves_the_old_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(OLD)
    with monkeypatch.context() as patch:
        fill_disk(file, patch)
        with pytest.raises(OSError):
            OUTPUTS[name](file)
    assert file.read_text() == OLD
    assert not [one for one in file.parent.iterdir() if one.name.startswith(".")], "nothing of the new one is left"
    OUTPUTS[name](file)
    assert file.read_bytes() != OLD.encode()


@pytest.mark.parametrize("name", ["clutter-1.toml", "clutter-1.png"])
def test_a_disk_that_is_full_leaves_no_half_of_a_world(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        fill_disk(tmp_path / name, patch)
        with pytest.raises(OSError):
            world_made(tmp_path, tmp_path / "image.png")
    assert not [one for one in tmp_path.iterdir() if one.name.startswith(".") or one.name == name]
    world_made(tmp_path, tmp_path / "image.png")
    assert (tmp_path / name).is_file()


@pytest.mark.parametrize("name", ["clutter-1.toml", "clutter-1.png"])
def test_a_world_that_was_changed_is_not_made_again(name: str, tmp_path: Path) -> None:
    def make() -> tuple[int, str]:
        result = CliRunner().invoke(app, ["world", "make", "clutter", "--seed", "1", "--out", str(tmp_path)])
        return result.exit_code, result.output

    assert make()[0] == 0
    made = {one: one.read_bytes() for one in tmp_path.iterdir()}
    assert make()[0] == 0, "the same content is no reason to refuse"
    file = tmp_path / name
    file.write_bytes(made[file] + b"changed")
    assert make() == (2, f"{file}: is there with other content, and would be lost; choose another --out\n")
    assert {one: one.read_bytes() for one in tmp_path.iterdir()} == {**made, file: made[file] + b"changed"}
    other = next(one for one in made if one != file)
    other.unlink()
    assert make()[0] == 2 and not other.exists(), "nothing is written"


def test_the_picture_does_not_take_the_place_of_the_world(tmp_path: Path) -> None:
    place = ["--out", str(tmp_path), "--image", str(tmp_path / "clutter-1.png")]
    result = CliRunner().invoke(app, ["world", "make", "clutter", "--seed", "1", *place])
    assert result.exit_code == 2 and "is another file of this command" in result.output
    assert not list(tmp_path.iterdir())
