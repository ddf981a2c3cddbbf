"""What all experiments share: runs in several processes, and without what that needs."""

from __future__ import annotations

import sys

import pytest

from sitl.experiments.experiment import ExperimentError, each


def test_results_come_in_the_order_of_the_tasks() -> None:
    for jobs in (1, 2):
        assert list(each(jobs, pow, ((2, 3), (3, 2), (5, 1)))) == [8, 9, 5]


def test_only_several_processes_need_joblib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "joblib", None)
    assert list(each(1, pow, ((2, 3),))) == [8]
    with pytest.raises(ExperimentError, match=r"^--jobs 2: joblib is not installed; install .*\[experiments\]"):
        each(2, pow, ((2, 3),))
