"""What all experiments share: runs in several processes, and without what that needs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from sitl.experiments import experiment
from sitl.experiments.experiment import ExperimentError, each


def test_results_come_in_the_order_of_the_tasks() -> None:
    for jobs in (1, 2):
        assert list(each(jobs, pow, ((2, 3), (3, 2), (5, 1)))) == [8, 9, 5]


def test_only_several_processes_need_joblib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "joblib", None)
    assert list(each(1, pow, ((2, 3),))) == [8]
    with pytest.raises(ExperimentError, match=r"^--jobs 2: joblib is not installed; install .*\[experiments\]"):
        each(2, pow, ((2, 3),))
    with pytest.raises(ExperimentError, match=r"^--keep kept: joblib is not installed; install .*\[experiments\]"):
        each(1, pow, ((2, 3),), Path("kept"))


def noted(folder: Path, number: int) -> int:
    """Leaves a trace of each time that it is called."""
    with (folder / "calls").open("a") as calls:
        calls.write(f"{number} ")
    return 10 * number


def test_what_is_kept_is_not_made_again_unless_the_code_is_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep, calls = tmp_path / "kept", tmp_path / "calls"
    assert next(iter(each(1, noted, ((tmp_path, 1),), keep))) == 10
    assert list(each(1, noted, ((tmp_path, 1), (tmp_path, 2)), keep)) == [10, 20]
    assert calls.read_text() == "1 2 "
    monkeypatch.setattr(experiment, "code_digest", lambda: "other code")
    assert list(each(1, noted, ((tmp_path, 2),), keep)) == [20]
    assert calls.read_text() == "1 2 2 "
