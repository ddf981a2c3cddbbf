"""The keeper of a run: where nothing is kept, and what a person is told of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.supervision.keeper import Keeper
from tests.support.desk import Desk
from tests.support.whole import Log, Whole


@pytest.fixture
def whole(tmp_path: Path) -> Whole:
    return Whole(tmp_path)


def test_faults_that_stop_nothing_are_told_once(whole: Whole) -> None:
    whole.drive()
    whole.memory.problem = "The state cannot be saved"
    whole.tick()
    whole.tick()
    assert whole.companion.outcome.said.count("The state cannot be saved") == 1


def test_without_a_state_file_nothing_is_kept(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    executor = desk.begin()
    told: list[str] = []
    notifier: Any = type("Told", (), {"tell_faults": lambda self, run, now_s, problem: told.append(problem)})()
    unused: Any = None
    keeper = Keeper(desk.run, None, Log(), notifier, unused, unused)
    keeper.note(10.0, done=True)
    keeper.tell_faults(10.0)
    assert not keeper.resume(executor, 10.0) and told == [""]
