"""The report's table of single runs: each with its command, what went wrong first, no more than a browser bears."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path

import pytest

from sitl.campaign import runs_table
from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.run_spec import RunResult, specs_of

TABLE = CampaignTable(name="a", worlds=["clutter"], runs=5, controllers=["points", "motion-ga"])
RESULT = RunResult("points", "reached", 1, 1, bound_s=25.0, clearance_m=0.4, said="done")
SPECS = list(specs_of(TABLE))
RESULTS = {
    4: replace(RESULT, seconds=10.0, touched=1),
    3: replace(RESULT, seconds=20.0, outcome="unreachable", reached=0, said="<lost>"),
}
RUNS = [(spec, RESULTS.get(spec.seed, replace(RESULT, seconds=50.0 + spec.seed))) for spec in SPECS]


def rows(text: str) -> list[list[str]]:
    body = text.partition("<tbody>")[2].partition("</tbody>")[0]
    found = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", body)]
    return [[html.unescape(re.sub(r"<.*?>", "", cell)) for cell in row] for row in found]


def test_every_run_has_a_row_with_its_command_and_what_went_wrong_comes_first() -> None:
    text = runs_table.runs_table(TABLE, RUNS, Path("my runs/c.toml"))
    found = rows(text)
    seeds = [int(row[2]) for row in found]
    assert seeds == [4, 4, 3, 3, 2, 2, 1, 1, 0, 0], "broken policies, not complete, then the longest"
    assert found[0][:2] == ["clutter", "points"] and found[0][3] == "contact" and "<lost>" not in text
    commands = {row[-1] for row in found}
    assert commands == {
        f"rover-sitl campaign 'my runs/c.toml' --replay {spec.id} --record out/{spec.id}" for spec in SPECS
    }
    assert "planner hybrid, sensors own" in text, "what no column says is the same in every run"


def test_with_too_many_runs_the_first_are_shown_and_that_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs_table, "MOST_ROWS", 3)
    text = runs_table.runs_table(TABLE, RUNS, Path("c.toml"))
    assert [int(row[2]) for row in rows(text)] == [4, 4, 3]
    assert "The first 3 of 10 runs; runs.csv has them all." in text
