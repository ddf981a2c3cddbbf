"""Who drives a campaign's runs: what they do when a file changes under them."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from distributed import LocalCluster

from companion.cli import kernel_cache
from sitl.campaign import workers
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests, RunStore
from sitl.campaign.workers import driven_here, driven_on
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


@pytest.fixture
def cluster() -> Iterator[LocalCluster]:
    """A scheduler without workers."""
    with LocalCluster(n_workers=0, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        yield cluster


def test_a_cluster_without_workers_is_one_line_and_not_a_wait_for_ever(
    tmp_path: Path, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "WORKERS_S", 0.2)
    with pytest.raises(CampaignError, match=r"no worker has come within 0\.2 s; start some: dask worker inproc:"):
        next(driven_on(SPECS, Digests(tmp_path), cluster.scheduler_address))
    said = logging.getLogger("distributed.client")
    assert not said.isEnabledFor(logging.ERROR), "it printed a traceback where a scheduler had gone"


def test_workers_of_a_cluster_keep_kernels_as_the_programs_do(
    tmp_path: Path, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By numba's own rule they drove with kernels of older code, and each compiled anew beside the sources."""
    rules: list[str | None] = []

    def drive(spec: RunSpec, folder: Path) -> RunResult:
        rules.append(os.environ.get(kernel_cache.LOCATORS))
        return RESULT

    monkeypatch.setattr(workers, "drive", drive)
    monkeypatch.delenv(kernel_cache.LOCATORS)
    cluster.scale(1)
    results = dict(driven_on(SPECS[:2], Digests(tmp_path), cluster.scheduler_address))
    assert list(results.values()) == [RESULT, RESULT]
    assert rules == 2 * ["companion.cli.kernel_cache.Locator,UserProvidedCacheLocator"]
    alone = "import sys, sitl.campaign.worker_start; assert not {'numba', 'distributed'} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", alone], check=True)
