"""What runs come to: rows and pairs, from figures that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.report import page
from sitl.campaign.run_spec import RunResult, RunSpec, specs_of
from sitl.campaign.summary import HEAD, PAIR_HEAD, differences, interval, rows, varied
from sitl.campaign.tables import records_of

TABLE = CampaignTable(name="a <u>", worlds=["clutter"], runs=20, controllers=["points", "motion-ga"])
RESULT = RunResult("points", "reached", 1, 1, bound_s=25.0, metres=40.0, clearance_m=0.4, said="done")


def result_of(spec: RunSpec) -> RunResult:
    """Planned motions take 10 s less on every ground; on the ground of seed 3 points reach nothing."""
    seconds = 50.0 + spec.seed - (10.0 if spec.controller == "motion-ga" else 0.0)
    missed = spec.seed == 3 and spec.controller == "points"
    return replace(RESULT, seconds=seconds, reached=0 if missed else 1, said="<lost>" if missed else "done")


RUNS = [(spec, result_of(spec)) for spec in specs_of(TABLE)]


def test_a_row_for_each_combination_and_one_for_all() -> None:
    assert varied(TABLE) == ["world", "controller"]
    found = {line[1]: dict(zip(HEAD, line[2:], strict=True)) for line in rows(TABLE, RUNS)}
    assert found["points"]["runs"] == "20" and found["points"]["complete"].startswith("0.950 (0.751 to 0.999)")
    assert (
        found["points"]["missed"] == "1"
        and found["motion-ga"]["mean s"] == "49.5"
        and found["motion-ga"]["/bound"] == "1.98"
    )
    assert found[""]["runs"] == "40"


def test_a_pair_differs_in_one_axis_only_and_both_must_be_complete() -> None:
    (pair,) = differences(TABLE, RUNS)
    cells = dict(zip(PAIR_HEAD, pair.cells, strict=True))
    assert (pair.axis, pair.world, pair.value, pair.other) == ("controller", "clutter", "motion-ga", "points")
    assert cells["pairs"] == "20" and cells["both complete"] == "19"
    assert (cells["only this"], cells["only other"]) == ("1", "0")
    assert cells["difference s"] == "-10.0 (-10.0 to -10.0)", "on every pair the same"


def test_a_run_without_a_partner_is_no_pair() -> None:
    (pair,) = differences(TABLE, RUNS[:-1])
    assert pair.cells[0] == "19"


def test_an_interval_holds_the_mean_as_often_as_it_says() -> None:
    """Of 200 samples of 30 the interval misses the true mean in 10 on average; 25 or more: a chance below 1e-4."""
    rng = np.random.default_rng(1)
    bounds = [interval(rng.normal(5.0, 2.0, 30)) for _ in range(200)]
    assert sum(not low < 5.0 < high for low, high in bounds) < 25
    assert bounds[0][1] - bounds[0][0] == pytest.approx(4.0 * 2.0 / 30**0.5, rel=0.5)


def test_the_page_tells_of_every_run_that_was_not_complete_and_loads_nothing(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = page(TABLE, RUNS, tmp_path / "c.toml")
    missed = next(spec for spec, result in RUNS if not result.complete)
    assert missed.id in text and "&lt;lost&gt;" in text and "<u>" not in text and "<lost>" not in text
    assert "http" not in text and "--replay ID" in text and text.count("data:image/png") == 1


def test_tables_for_other_programs_have_a_record_a_run() -> None:
    records = records_of(RUNS)
    assert len(records) == 40 and records[0]["seed"] == 0 and "dwelt" not in records[0]
    assert sum(not one["complete"] for one in records) == 1
