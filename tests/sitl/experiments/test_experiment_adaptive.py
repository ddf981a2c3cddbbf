"""The experiment on control points that adapt, on a small scale."""

import numpy as np
import pytest

from sitl.experiments.adaptive_control_points import EPOCHS, WAYS, Entry, Search, run
from sitl.experiments.experiment import Options


def test_shares_count_every_search_and_never_fall():
    entry = Entry("known-1", "adaptive", (Search(1.0, 3), Search(1.0), Search(1.0, 1), Search(1.0, 7)))
    assert entry.share_within(np.array([0, 1, 3, 6, 7])).tolist() == [0.0, 0.25, 0.5, 0.5, 0.75]


def test_every_way_spends_the_same_epochs_at_most():
    assert {way.budget.max_epochs * len(way.budget.control_points) for way in WAYS.values()} == {EPOCHS}


@pytest.mark.thorough
@pytest.mark.thorough
def test_it_repeats_and_writes_its_part_of_the_docs(tmp_path):
    reports = [run(Options(runs=4, seed=5), lambda done, total: None) for _ in range(2)]
    results = [report.as_json()["results"] for report in reports]
    for one, other in zip(*results, strict=True):
        assert one["epochs"] == other["epochs"] and one["costs"] == other["costs"]
    assert len(results[0]) == 12 and all(len(row["epochs"]) == 4 for row in results[0])
    page, picture = tmp_path / "results.md", tmp_path / "images" / "adaptive-control-points.png"
    assert set(reports[0].write_docs(tmp_path)) == {page, picture} and picture.is_file()
    assert "| in turn | 4/4 |" in page.read_text(encoding="utf-8")
    assert len(reports[0].tables()) == 4
