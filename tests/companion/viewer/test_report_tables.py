"""Tables of several runs."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.cli.report import _line
from companion.control.following import AS_SHIPPED
from companion.control.model_estimate import ModelEstimate
from companion.replay.replay import ReplayResult
from companion.viewer.report_tables import Run, _figures, differences
from companion.viewer.run_tally import RunTally


def run_of(name: str, mission: str) -> Run:
    return Run(name, mission, RunTally(), cast(Any, SimpleNamespace()), None)


def test_runs_of_different_missions_are_compared_and_it_says_so() -> None:
    yard, other, rooms = run_of("a", "Yard"), run_of("b", "Yard"), run_of("c", "Rooms")
    assert "mission" not in differences([yard, other])["rows"][0][0]
    assert differences([yard, other, rooms])["rows"][0] == ["mission (they differ)", "Yard", "Yard", "Rooms"]


def test_one_stop_is_one_time() -> None:
    said = []
    for stops in (0, 1, 2):
        tally = RunTally()
        tally.stops = stops
        said += [
            row[1] for row in _figures(Run("a", "Yard", tally, ReplayResult(), None))["rows"] if "stopped" in row[0]
        ]
    assert said == ["0.0 s, 0 times", "0.0 s, 1 time", "0.0 s, 2 times"]


def test_it_tells_how_the_rover_followed_velocities() -> None:
    result = ReplayResult()
    last = ["differences of the replay", "none"]
    assert _figures(Run("a", "Yard", RunTally(), result, None))["rows"][-1] == last
    estimate = ModelEstimate(AS_SHIPPED, AS_SHIPPED)
    result.companion = cast(Any, SimpleNamespace(estimate=estimate, full_throttle_m_s=1.234))
    full, told = _figures(Run("a", "Yard", RunTally(), result, None))["rows"][-2:]
    assert full == ["speed at full throttle, as found", "1.2 m/s"]
    assert told[0] == "how it follows velocities" and told[1].startswith("after 0.30 s, gains 1.00 and loses 1.00 m/s")


@pytest.mark.parametrize(("size", "says"), [(3, "1 kB"), (42_300, "42 kB"), (99_999, "100 kB"), (640_000, "0.6 MB")])
def test_sizes_are_told_so_that_they_say_something(tmp_path: Path, size: int, says: str) -> None:
    (tmp_path / "d.mp4").write_bytes(bytes(size))
    assert _line("film", tmp_path / "d.mp4") == f"film: {tmp_path / 'd.mp4'} ({says})"
