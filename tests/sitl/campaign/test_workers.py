"""Who drives a campaign's runs: what they do when a file changes under them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sitl.campaign import workers
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests, RunStore
from sitl.campaign.workers import driven_here
from tests.sitl.campaign.test_run_store import RESULT, SPECS

MISSION = "[[target]]\nnorth_m = {}\neast_m = 2.0\n"


def test_a_mission_that_is_edited_while_a_campaign_runs_ends_it_and_its_run_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "m.toml"
    file.write_text(MISSION.format(1.0))
    specs = [replace(spec, world="m.toml") for spec in SPECS[:3]]
    driven: list[RunSpec] = []

    def drive(spec: RunSpec, folder: Path) -> RunResult:
        driven.append(spec)
        if len(driven) == 2:
            file.write_text(MISSION.format(3.0))
        return RESULT

    monkeypatch.setattr(workers, "drive", drive)
    digests = Digests(tmp_path)
    store = RunStore(tmp_path / "runs.jsonl", digests.of)
    with pytest.raises(CampaignError, match=r"a file of the run was changed .*m\.toml.*drives again"):
        for spec, result in driven_here(specs, digests, 1):
            store.add(spec, result)
    assert [*store.results] == [specs[0].id]
    later = RunStore(store.file, Digests(tmp_path).of)
    assert later.results == {} and later.older == 1, "what was driven with the old mission does not count"
    file.write_text(MISSION.format(1.0))
    assert [*RunStore(store.file, Digests(tmp_path).of).results] == [specs[0].id], "put back, it counts again"
