"""Tables of several runs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from companion.viewer.report_tables import Run, differences
from companion.viewer.run_tally import RunTally


def run_of(name: str, mission: str) -> Run:
    return Run(name, mission, RunTally(), cast(Any, SimpleNamespace()), None)


def test_runs_of_different_missions_are_compared_and_it_says_so() -> None:
    yard, other, rooms = run_of("a", "Yard"), run_of("b", "Yard"), run_of("c", "Rooms")
    assert "mission" not in differences([yard, other])["rows"][0][0]
    assert differences([yard, other, rooms])["rows"][0] == ["mission (they differ)", "Yard", "Yard", "Rooms"]
