"""The experiment ``wang-table4`` as a user starts it, with few runs."""

import json

import pytest
from typer.testing import CliRunner

from sitl.cli.commands import app

RUNS = 2


@pytest.mark.thorough
def test_wang_table4(tmp_path):
    file, docs = tmp_path / "figures.json", tmp_path / "docs"
    arguments = [
        "experiment",
        "wang-table4",
        "--runs",
        str(RUNS),
        "--seed",
        "1000",
        "--json",
        str(file),
        "--docs",
        str(docs),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert [(r["criterion"], r["environment"]) for r in figures["results"]] == [
        (criterion, environment) for criterion in ("time", "length") for environment in (1, 2, 3, 4)
    ]
    for entry in figures["results"]:
        assert entry["found"] == entry["tried"] == RUNS
        assert entry["touched"] == 0 and entry["least_gap_m"] >= 1.0 - 1e-3
        assert 1e3 * entry["paper"]["all_s"] >= 100.0 * entry["all_ms"]
    # Single first times are a few milliseconds on an idle computer; the sum is less at the mercy of a busy one.
    first_s = sum(entry["paper"]["first_s"] for entry in figures["results"])
    assert 1e3 * first_s >= 100.0 * sum(entry["first_ms"] for entry in figures["results"])
    by_time, by_length = figures["results"][:4], figures["results"][4:]
    for fast, short in zip(by_time, by_length, strict=True):
        assert fast["offline_time_s"] <= short["offline_time_s"]
        assert fast["top_speed_share"] >= 0.75 > short["top_speed_share"]
    variants = {(one["variant"], one["environment"]): one for one in figures["variants"]}
    assert len(variants) == 4 * 4 and all(one["found"] == RUNS for one in variants.values())
    for number in (1, 2, 3, 4):
        usual, fastest = variants["as above", number], variants["fastest speed only", number]
        assert usual["offline_time_s"] == by_time[number - 1]["offline_time_s"], "the same seeds"
        assert fastest["offline_length_m"] / fastest["offline_time_s"] == pytest.approx(0.7), (
            "the fastest, not the slowest"
        )
        bare = variants["no straight line", number]
        assert bare["first_generations"] > 0 and bare["offline_length_m"] >= usual["offline_length_m"] - 30.0
    for entry in figures["results"]:
        assert 0 <= entry["offline_first_generations"] <= 5000 and entry["offline_first_ms"] > 0.0
    page = (docs / "results.md").read_text(encoding="utf-8")
    fewer = sum(one["first_generations"] < one["offline_first_generations"] for one in figures["results"])
    assert f"generations until the first feasible path in {fewer}, time until then in " in page
    assert (docs / "images" / "wang-table4.png").stat().st_size > 10_000
    assert "Wang, Sillitoe & Mulvaney 2007" in (docs / "results.md").read_text(encoding="utf-8")
