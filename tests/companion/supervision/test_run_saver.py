"""The run saver: where nothing is saved, and what a person is told of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.supervision.run_saver import RunSaver
from tests.support.desk import Desk
from tests.support.whole import Log, Whole


def test_faults_that_stop_nothing_are_told_once(whole: Whole) -> None:
    whole.drive()
    whole.memory.problem = "The state cannot be saved"
    whole.tick()
    whole.tick()
    assert whole.companion.outcome.said.count("The state cannot be saved") == 1


class Unsaved:
    """A checkpointer whose disk is full."""

    def problem_text(self, log: object) -> str:
        return "The state cannot be saved"


def test_a_record_that_has_ended_does_not_hide_that_the_state_cannot_be_saved() -> None:
    """One full disk is usual for both."""
    log, unused = Log(), Unsaved()
    log.problem = "the record has ended"
    saver: Any = RunSaver
    told = saver(None, unused, log, None, None).note_problems()
    assert told == ("the record has ended", "The state cannot be saved")


def test_without_a_state_file_nothing_is_saved(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    executor = desk.begin()
    unused: Any = None
    saver = RunSaver(desk.run, None, Log(), unused, unused)
    saver.save(10.0, done=True)
    assert not saver.resume(executor, 10.0) and saver.note_problems() == ()
