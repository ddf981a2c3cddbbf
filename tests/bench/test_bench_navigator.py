"""Figures of the navigator driven field by field on the maps of 100 x 50 fields (``make bench``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.bench.cases import paper_cases
from companion.core.clock import stopwatch_s
from companion.core.frames import Pose
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.mapping.evidence_kernels import soften
from companion.mapping.evidence_map import MAX_SOFT_WEIGHT
from companion.navigation.field_step import SearchKind
from companion.navigation.search_budget import PathSearcher
from companion.navigation.turning_cost import with_turning_cost
from companion.planning.problem import PlanStatus
from companion.planning.registry import make_planner, warm_up
from companion.settings import Settings
from sitl.experiments.experiment import START, TARGET, load_maps
from sitl.experiments.field_level import Outcome, drive_fields
from sitl.experiments.kwasniewski_maps import PROFILES, TITLES, profile_settings

RUNS = 100
PLANNING_LIMIT_MS = 20.0
FIELD_STEP_LIMIT_MS = 5.0
MAPS = Path(__file__).resolve().parents[2] / "missions" / "maps"
LARGE, LARGE_STEPS, LARGE_SEARCHES, LARGE_STEP_LIMIT_MS = 40, 3000, 40, 150.0


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


@pytest.mark.parametrize("name", list(TITLES))
def test_field_steps_on_a_map_of_eight_million_fields(name):
    """Maps at 40 times their size: 99 % of the first steps of a run take less than 150 ms, searches included."""
    warm_up()
    (case,) = (case for case in paper_cases(MAPS, (LARGE,)) if case.name == name)
    run = drive_fields(Grid(case.weights), *case.ends[0], Settings(), 0, LARGE_STEPS)
    steps_ms = 1e3 * np.array(run.step_seconds)
    print(
        f"\n{name} x{LARGE}: {run.steps} steps, {run.searches} searches, "
        f"field step median {np.median(steps_ms):.2f} ms, "
        f"p99 {np.percentile(steps_ms, 99):.1f} ms, largest {steps_ms.max():.1f} ms"
    )
    assert run.outcome is Outcome.REACHED or run.steps == LARGE_STEPS
    assert np.percentile(steps_ms, 99) < LARGE_STEP_LIMIT_MS


@pytest.mark.parametrize("name", list(TITLES))
def test_searches_of_a_known_map_of_eight_million_fields(name):
    """As a rover asks: a known map, costlier ground round obstacles, from many places to the target."""
    warm_up()
    settings = Settings()
    (case,) = (case for case in paper_cases(MAPS, (LARGE,)) if case.name == name)
    free, weights, rng = np.argwhere(case.weights < OBSTACLE), case.weights, np.random.default_rng(0)
    height, width = weights.shape
    soften(weights, (0, 0, width, height), settings.mapping.soft_reach_m, settings.mapping.soft_cost, MAX_SOFT_WEIGHT)
    searcher = PathSearcher(make_planner("hybrid", settings.planner), rng)
    grid, seconds = Grid(weights), []
    for y, x in free[rng.integers(len(free), size=LARGE_SEARCHES)].tolist():
        pose = Pose(y + 0.5, x + 0.5, rng.uniform(-np.pi, np.pi), 0.0)
        began_s = stopwatch_s()
        turned = with_turning_cost(grid, pose, settings.guidance)
        result = searcher.search(turned.weights, SearchKind.THOROUGH, Cell(x, y), case.ends[0][1], settings.navigator)
        seconds.append(stopwatch_s() - began_s)
        assert result.status is not PlanStatus.BUDGET_SPENT
    times_ms = 1e3 * np.array(seconds)
    print(f"\n{name} x{LARGE}, known: search median {np.median(times_ms):.1f} ms, largest {times_ms.max():.1f} ms")
    # One step in five searches, so the slowest in a hundred steps are the slowest in twenty searches.
    assert np.percentile(times_ms, 95) < LARGE_STEP_LIMIT_MS
