"""What runs come to: rows and pairs, from figures that are known."""

from __future__ import annotations

import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.pictures import times
from sitl.campaign.policies import ERROR
from sitl.campaign.report import page
from sitl.campaign.run_spec import RunResult, RunSpec, specs_of
from sitl.campaign.summary import HEAD, PAIR_HEAD, differences, interval, labels, rows, short_labels, varied
from sitl.campaign.tables import records_of
from sitl.cli.campaign_outputs import put_out
from sitl.generators.measures import Difficulty

TABLE = CampaignTable(name="a", worlds=["clutter"], runs=20, controllers=["points", "motion-ga"])
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
    assert found["points"]["95 %"] == "57.0 to 62.7"
    of_all = found[""]
    assert (of_all["runs"], of_all["complete"], of_all["95 %"]) == ("40", "0.975", "-"), "two runs lie on each ground"


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


@pytest.mark.parametrize("count", [3, 5, 30])
def test_an_interval_holds_the_mean_as_often_as_it_says(count: int) -> None:
    """Of 400 samples the interval misses the true mean in 20 on average; fewer than 5 or more than 40: below 1e-4."""
    rng = np.random.default_rng(1)
    bounds = [interval(rng.normal(5.0, 2.0, count)) for _ in range(400)]
    assert 5 <= sum(not low < 5.0 < high for low, high in bounds) <= 40


def test_pairs_of_one_seed_count_as_one() -> None:
    """Another list that changes nothing makes no interval narrower."""
    table = TABLE.model_copy(update={"late_s": [0.0, 0.1, 0.2, 0.3]})
    rng = np.random.default_rng(2)
    noise = {(seed, name): rng.normal(0.0, 5.0) for seed in range(20) for name in table.controllers}
    runs = [(spec, replace(RESULT, seconds=50.0 + noise[spec.seed, spec.controller])) for spec in specs_of(table)]
    of_all = next(one for one in differences(table, runs) if one.axis == "controller")
    alone = [(spec, result) for spec, result in runs if spec.late_s == 0.0]
    (of_one,) = differences(table.model_copy(update={"late_s": [0.0]}), alone)
    assert of_all.cells[3] == of_one.cells[3] and of_all.cells[0] == "80"


def test_the_means_of_a_pair_differ_by_what_the_pair_differs() -> None:
    """Also where one seed has more complete pairs than another: each seed counts once in every figure."""
    table = CampaignTable(
        name="a", worlds=["clutter"], runs=2, controllers=["points", "motion-ga"], planners=["hybrid", "astar"]
    )
    seconds = {("hybrid", 0): (60.0, 50.0), ("astar", 0): (80.0, 60.0), ("hybrid", 1): (100.0, 40.0)}
    runs = [
        (spec, replace(RESULT, seconds=seconds[spec.planner, spec.seed][spec.controller == "motion-ga"]))
        for spec in specs_of(table)
        if (spec.planner, spec.seed) in seconds
    ]
    (pair,) = (one for one in differences(table, runs) if one.axis == "controller")
    cells = dict(zip(PAIR_HEAD, pair.cells, strict=True))
    apart_s = float(cells["difference s"].split()[0])
    assert float(cells["mean s"]) - float(cells["against s"]) == pytest.approx(apart_s) == pytest.approx(-37.5)


def test_values_with_one_short_name_stay_apart() -> None:
    table = TABLE.model_copy(update={"worlds": ["a/m.toml", "b/m.toml", "c.toml"], "planners": ["p.q:A", "p.q:B"]})
    assert list(labels(table, "world").values()) == ["a/m.toml", "b/m.toml", "c"]
    assert list(labels(table, "planner").values()) == ["p.q:A", "p.q:B"]


def test_names_are_whole_on_a_narrow_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of ``theta-star`` there was ``thet...``."""
    table = TABLE.model_copy(update={"planners": ["hybrid", "theta-star"], "guard": [False, True], "runs": 1})
    runs = [(spec, replace(RESULT, reached=0)) for spec in specs_of(table)]
    put_out(Console(width=80), table, runs, Path("c.toml"), tmp_path)
    said = capsys.readouterr().out
    assert "clutter, theta-star, points," in said and "guard yes " in said and "\N{HORIZONTAL ELLIPSIS}" not in said


FAULTS = ["none", "link_outage start_s=1 duration_s=2; gps_noise start_s=60 metres=0.2"]


def test_values_in_words_leave_room_for_the_figures() -> None:
    """On the terminal names were cut off after four letters, and on the page the figures lay far to the right."""
    worlds = ["rooms least_door_m=1.6 movers=3", "yard house=1", "yard", "c.toml"]
    table = TABLE.model_copy(update={"worlds": worlds, "faults": FAULTS, "planners": ["p.q:A", "astar"]})
    assert list(short_labels(table, "world").values()) == ["rooms", "yard house=1", "yard", "c"]
    assert list(short_labels(table, "faults").values()) == ["none", "link_outage; gps_noise"]
    assert list(short_labels(table, "planner").values()) == ["p.q:A", "astar"]
    runs = [(spec, replace(RESULT, reached=0)) for spec in specs_of(table)]
    text = page(table, runs, Path("c.toml")).partition("<h2>Every run")[0]
    wide = set(re.findall(r'<td class="wide">(.*?)</td>', text))
    assert {worlds[0], FAULTS[1]} <= wide and "points" not in wide


def test_an_error_takes_part_in_no_time() -> None:
    runs = [(spec, RunResult("", ERROR, said="<lost>") if spec.seed < 5 else result) for spec, result in RUNS]
    line = rows(TABLE, runs)[0]
    cells = dict(zip(HEAD, line[2:], strict=True))
    assert cells["complete"].startswith("0.750") and cells["errors"] == "5" and cells["mean s"] == "62.0"
    assert "error in 10 runs" in page(TABLE, runs, Path("c.toml"))


def test_a_curve_keeps_its_colour_and_ends_at_its_share() -> None:
    table = TABLE.model_copy(update={"worlds": ["clutter", "rooms"]})
    runs = [
        (spec, replace(RESULT, seconds=40.0, reached=0 if (spec.world, spec.controller) == ("rooms", "points") else 1))
        for spec in specs_of(table)
    ]
    figure = times(table, runs)
    first, second = (panel.get_lines() for panel in figure.axes)
    assert len(first) == 2 and len(second) == 1
    assert second[0].get_color() == first[1].get_color() != first[0].get_color()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["points", "motion-ga"]
    assert first[0].get_ydata()[-1] == 1.0


def test_the_page_tells_of_every_run_and_loads_nothing(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = page(TABLE, RUNS, tmp_path / "c.toml")
    missed = next(spec for spec, result in RUNS if not result.complete)
    assert missed.id in text and "&lt;lost&gt;" in text and "<lost>" not in text
    assert "http" not in text and text.count("--replay ") == 40 and text.count("data:image/png") == 1


def test_tables_for_other_programs_have_a_record_a_run() -> None:
    records = records_of(RUNS)
    assert len(records) == 40 and records[0]["seed"] == 0 and "dwelt" not in records[0]
    assert sum(not one["complete"] for one in records) == 1
    ground = Difficulty(1.5, 4.25, 3.5, 5.0, 1.125)
    measured, other = records_of([(RUNS[0][0], replace(RESULT, ground=ground)), RUNS[1]])
    assert "ground" not in measured and measured.items() >= asdict(ground).items()
    assert list(other) == list(measured) and other["tortuosity"] is None
