"""Finds of a search are on the disk as soon as they are made small; a stop on the way loses none."""

from __future__ import annotations

import csv
import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.entry import StoppedError
from sitl.campaign.campaign_file import CampaignError, load_campaign
from sitl.campaign.run_spec import RunResult, RunSpec, specs_of
from sitl.cli import campaign as command
from sitl.cli import search
from sitl.cli.commands import app
from sitl.lockstep import Drive
from sitl.search.goals import Goal


class Drives:
    """Made-up runs: all touch something, and those without a latency refuse a setpoint, too."""

    def __init__(self, stop_at: int) -> None:
        self.number, self.stop_at = 0, stop_at

    def __call__(self, specs: Sequence[RunSpec], digests: object, jobs: int) -> Iterator[tuple[RunSpec, RunResult]]:
        for spec in specs:
            self.number += 1
            if self.number == self.stop_at:
                raise KeyboardInterrupt
            refused = "latency_s" not in spec.sensors
            yield spec, RunResult("points", "collision", 0, 1, touched=1, refused=refused, seconds=9.0)


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("check_all", "warm_up_all"):
        monkeypatch.setattr(search, name, lambda specs, folder: None)
    file = tmp_path / "c.toml"
    file.write_text('worlds = ["cylinders", "yard"]\n[search]\nparts = ["sensors"]\n')
    return file


def found(file: Path) -> list[str]:
    return sorted(one.name.rpartition("-")[0] for one in (file.parent / "out").glob("search-*/found/*.toml"))


def test_each_kind_of_find_is_made_small_and_written_once(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(search, "driven_here", Drives(10_000))
    search.search_campaign(campaign, Goal.COLLISION, 40, campaign.parent / "out", 1)
    assert found(campaign) == ["collision"] * 2 + ["refused"] * 2, "also what was found while making small"
    said = capsys.readouterr()
    assert said.out.splitlines()[-1].endswith(" finds of 4 kinds")
    assert "collision: cylinders, seed 0: driven again with less that differs" in said.err
    assert "collision: cylinders, seed 0: nothing" in said.err, "as far as it is"


def test_a_stop_after_the_first_find_leaves_it_written(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """They were written at the very end."""
    monkeypatch.setattr(search, "driven_here", Drives(14))
    with pytest.raises(StoppedError, match="13 runs, kept in"):
        search.search_campaign(campaign, Goal.COLLISION, 40, campaign.parent / "out", 1)
    assert found(campaign) == ["collision", "refused"]
    report = (campaign.parent / "out" / "search-collision" / "report.html").read_text()
    assert "The search was stopped" in report and report.count(".toml --replay ") == 2
    kept = campaign.parent / "out" / "search-collision" / "runs.jsonl"
    with kept.open("a") as file:
        file.write("{torn")
    capsys.readouterr()
    search.search_campaign(campaign, Goal.COLLISION, 40, campaign.parent / "out", 1)
    assert f"{kept}: 13 runs are there, 1 torn line left out" in capsys.readouterr().err


def test_every_find_can_be_driven_again_from_what_the_search_has_kept(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those that were not made small, too."""
    monkeypatch.setattr(search, "driven_here", Drives(14))
    out = campaign.parent / "out"
    with pytest.raises(StoppedError):
        search.search_campaign(campaign, Goal.COLLISION, 40, out, 1)
    place = out / "search-collision"
    with (place / "runs.jsonl").open("a") as kept:
        kept.write("{torn")
    report = (place / "report.html").read_text().partition("Every find")[2]
    found = re.findall(
        r"<code>rover-sitl (campaign .*? --search collision --out .*? --replay (\w+) --record .*?)</code>", report
    )
    with (place / "evaluations.csv").open(newline="") as table:
        assert {row["id"] for row in csv.DictReader(table)} < {run_id for _, run_id in found}, "all have gone wrong"
    driven: list[RunSpec] = []

    def prepared(spec: RunSpec, folder: Path, recorder: object) -> Drive:
        driven.append(spec)
        raise ValueError("driven")

    monkeypatch.setattr(command, "prepared", prepared)
    monkeypatch.chdir(campaign.parent)
    for line, run_id in found[-2:]:
        again = CliRunner().invoke(app, shlex.split(line))
        assert again.exit_code == 2 and "ended with an error: ValueError: driven" in again.output, again.output
        assert driven[-1].id == run_id
    assert (place / "runs.jsonl").read_text().endswith("{torn"), "who only reads repairs nothing"
    line = found[0][0].replace(found[0][1], "0" * 12)
    none = CliRunner().invoke(app, shlex.split(line))
    assert none.exit_code == 2 and f"no run of the search in {place / 'runs.jsonl'}" in none.output


def test_a_search_with_nothing_to_move_or_to_drive_is_one_line(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first ended in a traceback of the optimiser, the second said that no run went wrong."""
    monkeypatch.setattr(search, "driven_here", Drives(10_000))
    (campaign.parent / "m.toml").write_text("[[target]]\nnorth_m = 1.0\neast_m = 2.0\n")
    out = campaign.parent / "out"
    campaign.write_text('worlds = ["clutter", "m.toml"]\n[search]\nparts = ["world", "traffic"]\n')
    with pytest.raises(CampaignError, match=r"search\.parts: world, traffic: moves nothing in m\.toml"):
        search.search_campaign(campaign, Goal.COLLISION, 4, out, 1)
    bounds = '{ "guidance.min_speed_m_s" = [15.0, 16.0], "guidance.max_speed_m_s" = [0.1, 0.2] }'
    campaign.write_text(f'worlds = ["m.toml"]\n[search]\nparts = ["settings"]\nsettings = {bounds}\n')
    with pytest.raises(CampaignError, match=r"no run could be driven, all that was tried contradicts itself"):
        search.search_campaign(campaign, Goal.COLLISION, 4, out, 1)
    assert not (out / "search-collision" / "report.html").exists()


def test_report_and_table_tell_how_the_search_went_and_what_drives_finds_again(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "driven_here", Drives(10_000))
    search.search_campaign(campaign, Goal.COLLISION, 40, campaign.parent / "out", 1)
    place = campaign.parent / "out" / "search-collision"
    report = (place / "report.html").read_text()
    assert "40 of 40 runs in " in report and "was stopped" not in report and "data:image/png" in report
    for file in (place / "found").glob("*.toml"):
        run_id = file.stem.rpartition("-")[2]
        assert f"rover-sitl campaign {file} --replay {run_id} --record out/{run_id}" in report
        assert run_id in {spec.id for spec in specs_of(load_campaign(file))}
    with (place / "evaluations.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert [int(row["evaluation"]) for row in rows] == list(range(1, 41))
    assert [row["start"] for row in rows] == sorted((row["start"] for row in rows), key=int)
    assert all(row["distance"] == "-100.0" and "collision" in row["shows"].split() for row in rows)


def test_no_more_than_so_many_are_made_small(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(search, "driven_here", Drives(10_000))
    monkeypatch.setattr(search, "MOST_KEPT", 3)
    search.search_campaign(campaign, Goal.COLLISION, 40, campaign.parent / "out", 1)
    assert len(found(campaign)) == 3
    report = (campaign.parent / "out" / "search-collision" / "report.html").read_text()
    assert "1 more kinds were left out" in report
    assert capsys.readouterr().out.splitlines()[-1].endswith("; no more than 3 are made small, 1 were left out")
