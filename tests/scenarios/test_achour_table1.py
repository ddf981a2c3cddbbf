"""The experiment ``achour-table1`` as a user starts it, with few runs."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.planning.problem import Budget
from companion.planning.registry import make_planner
from sitl.cli.commands import app
from sitl.experiments.achour_environments import environments
from sitl.experiments.achour_table1 import NAME, run
from sitl.experiments.achour_trials import METHODS, SETTINGS, samples_of
from sitl.experiments.experiment import Options

RUNS = 2


@pytest.mark.thorough
def test_achour_table1(tmp_path):
    file, docs = tmp_path / "figures.json", tmp_path / "docs"
    arguments = ["experiment", NAME, "--runs", str(RUNS), "--seed", "50", "--json", str(file), "--docs", str(docs)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert figures["settings"]["achour"]["unit_fields"] == 10.0
    rows = {(row["environment"], row["method"]): row for row in figures["results"]}
    assert [*rows] == [(name, method) for name in "1234" for method in METHODS]
    for (name, method), row in rows.items():
        assert row["tried"] == RUNS == len(row["times_ms"]) and 0 < row["found"] <= RUNS
        assert row["straight_m"] <= row["length_m"] + 1e-9 and row["straight_nodes"] <= row["path_nodes"]
        if method == "theta-star":
            assert row["paper"] is None and row["found"] == RUNS
            continue
        assert row["length_m"] >= 0.99 * rows[name, "theta-star"]["length_m"]
        # Single times are at the mercy of what else the computer does; the median of a few is not, with this much room.
        assert 1e3 * row["paper"]["time_s"] >= 100.0 * row["time_ms"]
    assert all(rows[name, "achour"]["found"] == RUNS for name in "1234")
    page = (docs / "results.md").read_text(encoding="utf-8")
    assert (docs / "images" / f"{NAME}.png").stat().st_size > 10_000
    assert "Achour & Chaalal 2011" in page and all(text in page for text in ("24.02 s", "168.36 s", "1/5"))


@pytest.fixture(scope="module")
def report():
    return run(Options(runs=3, seed=7), lambda done, total: None)


@pytest.mark.thorough
def test_what_is_shown_is_what_the_planner_finds(report):
    for entry in report.entries:
        planner = make_planner(entry.method, SETTINGS)
        for trial in entry.trials:
            path = planner.plan(environments()[entry.environment], Budget(), np.random.default_rng(trial.seed)).path
            assert (path is not None) == trial.found
            if path is not None and path.curve is not None:
                shown = trial.straight if entry.method == "achour" else trial.nodes
                assert np.array_equal(path.curve, shown)


def test_the_samples_in_the_picture_are_those_of_the_search(report):
    """All nodes that the walk took without crossing are among them; crossing makes some others."""
    for name, problem in report.problems.items():
        trial = report.of(name, "achour").example
        samples = {tuple(sample) for sample in samples_of(problem, trial)}
        nodes = [tuple(node) for node in trial.nodes[1:-1].astype(int)]
        assert trial.at_once and sum(node in samples for node in nodes) > 0.3 * len(nodes)
