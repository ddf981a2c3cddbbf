"""Figures of the navigator driven field by field on the maps of 100 x 50 fields (``make bench``)."""

from __future__ import annotations

import numpy as np
import pytest

from companion.planning.registry import warm_up
from sitl.experiments.experiment import START, TARGET, load_maps
from sitl.experiments.kwasniewski_maps import PROFILES, TITLES, profile_settings
from sitl.field_level import Outcome, drive_fields

RUNS = 100
PLANNING_LIMIT_MS = 20.0
FIELD_STEP_LIMIT_MS = 5.0


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", list(TITLES))
def test_planning_of_a_run_and_a_field_step(benchmark, profile, name):
    """100 of 100 runs arrive; all planning of a run under 20 ms (median); a field step under 5 ms (99 %)."""
    warm_up()
    truth = load_maps(None, (name,))[name]
    settings = profile_settings(profile)
    seeds = iter(range(RUNS))
    runs = []

    def one_run():
        runs.append(drive_fields(truth, START, TARGET, settings, next(seeds)))

    benchmark.pedantic(one_run, rounds=RUNS, iterations=1)
    planning_ms = 1e3 * float(np.median([run.planning_s for run in runs]))
    p99_ms = 1e3 * float(np.percentile(np.concatenate([run.step_seconds for run in runs]), 99))
    print(f"\n{name}, {profile}: planning of a run {planning_ms:.2f} ms, field step p99 {p99_ms:.2f} ms")
    benchmark.extra_info.update(planning_median_ms=planning_ms, field_step_p99_ms=p99_ms)
    assert all(run.outcome is Outcome.REACHED for run in runs)
    assert planning_ms < PLANNING_LIMIT_MS
    assert p99_ms < FIELD_STEP_LIMIT_MS
