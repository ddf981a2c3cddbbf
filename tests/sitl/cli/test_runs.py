"""What commands that drive campaigns have in common."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from sitl.campaign.campaign_file import CampaignError
from sitl.cli import runs
from sitl.cli.runs import QUIET, alone_in, progress


def test_one_campaign_at_a_time_writes_into_a_folder(tmp_path: Path) -> None:
    told = r"another campaign writes its runs here; .*--out$"
    with alone_in(tmp_path), pytest.raises(CampaignError, match=told), alone_in(tmp_path):
        pass
    with alone_in(tmp_path):
        pass


def test_a_run_that_does_not_end_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(runs, "QUIET_S", 0.1)
    said: list[str] = []
    monkeypatch.setattr(runs, "_tell", said.append)
    with progress(Console(force_terminal=False), 2) as advance:
        while not said:
            pass
        advance(1)
    assert said == [QUIET, "1 of 2 runs"]
