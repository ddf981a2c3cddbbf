"""What all experiments share: runs in several processes, and without what that needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from sitl.experiments import experiment
from sitl.experiments.experiment import ExperimentError, each
from tests.support.served import wait_until


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


WAITS = """
import time
from pathlib import Path
from sitl.experiments.experiment import each

def wait(name):
    Path(sys.argv[1], name).touch()
    time.sleep(600.0)

if __name__ == "__main__":
    list(each(2, wait, (("a",), ("b",))))
"""


@pytest.mark.slow
def test_the_processes_end_with_one_that_is_killed(tmp_path: Path) -> None:
    script, begun = tmp_path / "waits.py", tmp_path / "begun"
    script.write_text(WAITS.replace("sys.argv[1]", repr(str(begun))))
    begun.mkdir()
    with subprocess.Popen([sys.executable, script]) as run:
        wait_until(lambda: len(list(begun.iterdir())) == 2)
        children = psutil.Process(run.pid).children(recursive=True)
        run.kill()
    left = psutil.wait_procs(children, timeout=30.0)[1]
    for child in left:
        child.kill()
    assert len(children) >= 2 and not left
