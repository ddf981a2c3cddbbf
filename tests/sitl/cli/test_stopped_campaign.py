"""A campaign that is stopped reports what is done, and goes on."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from companion.cli.entry import StoppedError
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.cli import campaign as command
from tests.sitl.campaign.test_run_store import RESULT


class Drives:
    """Made-up runs, until Ctrl-C."""

    def __init__(self, stop_after: int) -> None:
        self.stop_after = stop_after

    def __call__(self, specs: Sequence[RunSpec], digests: object, jobs: int) -> Iterator[tuple[RunSpec, RunResult]]:
        for number, spec in enumerate(specs):
            if number == self.stop_after:
                raise KeyboardInterrupt
            yield spec, replace(RESULT, seconds=30.0 + spec.seed)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("check_all", "warm_up_all"):
        monkeypatch.setattr(command, name, lambda specs, folder: None)
    file = tmp_path / "c.toml"
    file.write_text('worlds = ["clutter"]\nruns = 5\n')
    return file


def test_what_is_done_is_reported_with_how_many_of_how_many(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = file.parent / "out"
    monkeypatch.setattr(command, "driven_here", Drives(2))
    with pytest.raises(StoppedError, match="2 of 5 runs, kept in"):
        command.drive_campaign(file, out, 1)
    report = (out / "report.html").read_text()
    assert "2 of 5 runs, seeds 0 to 4. <b>Not all runs are done: 3 are left.</b>" in report
    assert len((out / "runs.csv").read_text().splitlines()) == 3
    assert "c: 2 of 5 runs" in capsys.readouterr().out
    monkeypatch.setattr(command, "driven_here", Drives(1))
    with pytest.raises(StoppedError, match="3 of 5 runs, kept in"):
        command.drive_campaign(file, out, 1)
    told = capsys.readouterr()
    assert "c: 3 of 5 runs" in told.out
    counted = re.findall(r"\d+ of \d+ runs", told.err)
    assert counted == ["2 of 5 runs", "3 of 5 runs"], "what is there, and how far it came: all count the whole campaign"
    monkeypatch.setattr(command, "driven_here", Drives(5))
    assert len(command.drive_campaign(file, out, 1)) == 5
    report = (out / "report.html").read_text()
    assert "5 of 5 runs" in report and "Not all" not in report


def test_stopped_before_the_first_run_there_is_nothing_to_report(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "driven_here", Drives(0))
    with pytest.raises(StoppedError, match="0 of 5 runs"):
        command.drive_campaign(file, file.parent / "out", 1)
    assert not (file.parent / "out" / "report.html").exists()
