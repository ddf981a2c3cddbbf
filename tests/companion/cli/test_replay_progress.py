"""The line that shows how far a replay is: there on a terminal, and nothing of it elsewhere."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
import rich.console

from companion.cli import replay_progress
from companion.cli.replay_progress import watched_replay
from companion.recording.reader import load_record
from companion.recording.record_clock import record_clock
from companion.replay.replay import replay
from tests.support.records import recorded
from tests.support.rig import yard


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("yard")
    return recorded(folder / "record", yard(folder))


@pytest.mark.thorough
@pytest.mark.parametrize("terminal", [True, False])
def test_it_is_drawn_on_a_terminal_only_and_changes_nothing(
    record: Path, terminal: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = io.StringIO()
    console = rich.console.Console(file=drawn, force_terminal=terminal, width=80)
    monkeypatch.setattr(replay_progress, "Console", lambda stderr: console)
    shown = watched_replay(load_record(record))
    told = load_record(record)
    assert shown.seconds == replay(told).seconds == pytest.approx(record_clock(told).length_s, abs=0.1)
    assert shown.differences == []
    if terminal:
        percents = [int(found) for found in re.findall(r"(\d+)%", drawn.getvalue())]
        assert "replaying record" in drawn.getvalue()
        assert percents == sorted(percents) and percents[0] == 0 and percents[-1] > 50
    else:
        assert drawn.getvalue() == ""
