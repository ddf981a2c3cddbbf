"""Output files that cannot be written after the work is done: a full disk (/dev/full), or a path of no file."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.recording.record_format import RecordError
from companion.recording.recorder import unused
from sitl.cli.commands import app
from tests.support.full_disk import full_after
from tests.support.reports import report_data_in

YARD = "[grid]\nsize = [20, 20]\nhome = [3, 3]\n[sitl]\nsensors = 'lidar-360'\n[[target]]\nfield = [6, 3]\n"
FULL = "cannot be written: No space left on device; choose another place"


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "yard.toml"
    path.write_text(YARD)
    return path


@pytest.mark.thorough
def test_a_full_disk_is_one_line_for_each_file_and_keeps_the_others(mission: Path, tmp_path: Path) -> None:
    for name in ("run.png", "seen.pgm.new"):
        (tmp_path / name).symlink_to("/dev/full")
    image, stem, figures = tmp_path / "run.png", tmp_path / "seen", tmp_path / "run.json"
    arguments = ["drive", mission, "--image", image, "--map", stem, "--json", figures]
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 5, "driven"
    assert result.stderr.splitlines() == [f"{image}: {FULL}", f"{stem}.pgm: {FULL}"]
    assert "outcome: reached" in result.stdout
    assert json.loads(figures.read_text())["outcome"] == "reached"


@pytest.mark.thorough
def test_a_disk_that_gets_full_leaves_the_old_files_and_nothing_cut(mission: Path, tmp_path: Path) -> None:
    image, figures = tmp_path / "run.png", tmp_path / "run.json"
    for old in (image, figures):
        old.write_text("old")
    with full_after(300):
        result = CliRunner().invoke(app, ["drive", str(mission), "--image", str(image), "--json", str(figures)])
    says = "cannot be written: File too large; choose another place"
    assert (result.exit_code, result.stderr.splitlines()) == (5, [f"{image}: {says}", f"{figures}: {says}"])
    assert sorted(tmp_path.iterdir()) == [figures, image, mission]
    assert image.read_text() == figures.read_text() == "old"


def test_a_record_that_ends_early_is_told_by_the_exit_code(mission: Path, tmp_path: Path) -> None:
    record = tmp_path / "record"
    with full_after(20_000):
        result = CliRunner().invoke(app, ["drive", str(mission), "--record", str(record)])
    assert result.exit_code == 5 and f"{record}: the record has ended: File too large" in result.output


@pytest.mark.thorough
@pytest.mark.parametrize("command", [["drive", "--json"], ["physics", "--port", "1", "--write-params"]])
def test_a_full_disk_is_one_line(mission: Path, command: list[str]) -> None:
    result = CliRunner().invoke(app, [*command, "/dev/full", str(mission)])
    assert (result.exit_code, result.stderr) == (5 if command[0] == "drive" else 2, f"/dev/full: {FULL}\n")


@pytest.mark.parametrize("option", ["--json", "--map", "--report", "--write-params"])
@pytest.mark.parametrize("path", ["/", ".", ".."])
def test_a_path_that_names_no_file_is_one_line(mission: Path, option: str, path: str) -> None:
    command = "physics" if option == "--write-params" else "drive"
    result = CliRunner().invoke(app, [command, str(mission), option, path])
    assert (result.exit_code, result.stderr) == (2, f"{path}: is a folder, not a file; add a file's name\n")


@pytest.mark.thorough
def test_a_report_needs_no_record_and_leaves_none(mission: Path, tmp_path: Path) -> None:
    report = tmp_path / "new" / "run.html"
    result = CliRunner().invoke(app, ["drive", str(mission), "--report", str(report)], env={"COLUMNS": "200"})
    assert result.exit_code == 0 and f"report:  {report} (0." in result.stdout and "record:" not in result.stdout
    assert [file.name for file in report.parent.iterdir()] == ["run.html"]
    told = report_data_in(report)
    assert (
        [one["state"] for one in told["frames"] if "state" in one][-1] == "ended"
        and told["decisions"]
        and told["contacts"] == []
    )
    for other, says in (("--record", "another file"), ("--json", "another file")):
        bad = CliRunner().invoke(app, ["drive", str(mission), "--report", str(report), other, str(report)])
        assert bad.exit_code == 2 and says in bad.stderr and bad.stderr.count("\n") == 1 and bad.stdout == ""
    assert report_data_in(report) == told, "it is as it was"


def test_a_disk_that_is_full_at_the_start_is_told_with_the_file_that_was_asked_for(
    mission: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise RecordError("/x/.record-1: cannot record here") from OSError(28, "No space left on device")

    monkeypatch.setattr("sitl.cli.drive.Recorder", full)
    report, record = tmp_path / "r.html", tmp_path / "rec"
    told = [CliRunner().invoke(app, ["drive", str(mission), option, str(place)])
            for option, place in (("--report", report), ("--record", record))]  # fmt: skip
    assert [one.exit_code for one in told] == [2, 2]
    assert told[0].stderr == f"{report}: {FULL}\n" and "cannot record here" in told[1].stderr


@pytest.mark.thorough
def test_a_standard_output_that_is_full_is_one_line(mission: Path) -> None:
    code = "from sitl.cli.main import main; main()"
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-c", code, "drive", str(mission)],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=100, check=False,
        )  # fmt: skip
    assert done.stderr == "rover-sitl: standard output cannot be written: No space left on device\n"
    assert done.returncode == 2


def test_two_equal_drives_give_the_same_record_byte_for_byte(mission: Path, tmp_path: Path) -> None:
    records = []
    for name in ("one", "two"):
        assert CliRunner().invoke(app, ["drive", str(mission), "--record", str(tmp_path / name)]).exit_code == 0
        files = (path for path in (tmp_path / name).rglob("*") if path.is_file())
        records.append({path.relative_to(tmp_path / name): path.read_bytes() for path in files})
    assert {"link.tlog", "rounds.bin", "decisions.jsonl", "meta.json"} <= {str(path) for path in records[0]}
    assert records[0] == records[1]


def test_texts_are_told_as_they_come_and_a_run_that_waits_for_a_person_is_ended(mission: Path) -> None:
    plan = mission.with_name("plan.toml")
    plan.write_text('[[fault]]\nkind = "pilot"\nsince = "driving"\nstart_s = 0.5\nmode = "HOLD"\n')
    result = CliRunner().invoke(app, ["drive", str(mission), "--faults", str(plan)])
    assert result.exit_code == 3
    lines = [line.split(" s  ", 1)[-1] for line in result.stdout.splitlines() if line.startswith("yard: ")]
    heading = next(index for index, line in enumerate(lines) if line.startswith("Heading for "))
    silent = lines.index("Companion no longer steers: mode is not GUIDED; it waits for a person to set GUIDED")
    why = "stopped: mode is not GUIDED, waiting for a person to set GUIDED"
    ended = lines.index(f"ended: nobody is here to do what the companion waits for ({why})")
    assert heading < silent < ended and len(lines) < 12
    assert "outcome: incomplete" in result.stdout


@pytest.mark.parametrize("option", ["--image", "--json", "--map"])
def test_a_folder_that_may_not_be_entered_is_one_line(
    mission: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, option: str
) -> None:
    """Also for root, who may enter any: so the answer of the system is made up."""
    looked_at = os.stat

    def stat(path: str | Path | int, *args: object, **options: object) -> os.stat_result:
        if "locked" in str(path):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return looked_at(path, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "stat", stat)
    assert unused(tmp_path / "locked") == tmp_path / "locked"
    place = tmp_path / "locked" / "x.png"
    result = CliRunner().invoke(app, ["drive", str(mission), option, str(place)])
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert str(tmp_path / "locked") in result.stderr and "Permission denied" in result.stderr
