"""A report tells what ended a drive, also one that no person has stopped."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.recording.reader import load_record
from companion.recording.recorder import Recorder
from companion.replay.replay import Observers, replay
from companion.safety.reasons import EndReason
from companion.settings import Settings
from companion.viewer.report_data import ReportWatch, joined, run_of
from companion.viewer.run_tally import RunTally
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from tests.support.rig import yard


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (EndReason.NOBODY_HERE, "ended, nobody is here"),
        (EndReason.NEVER_BEGINS, "ended, connecting since the start; it cannot be expected any more"),
        (EndReason.STOPPED_BY_USER, "stopped by the user"),
        (None, "ended, time limit reached"),
    ],
)
def test_a_report_tells_what_ended_the_drive(tmp_path: Path, asked: EndReason | None, line: str) -> None:
    mission, settings = yard(tmp_path), Settings()
    recorder = Recorder(tmp_path / "record", mission, settings, 0, arm=True, start_us=0)
    run = Drive(mission, scenario_from_mission(mission), settings, 0, recorder, time_limit_s=1.0)
    if asked is not None:
        run.companion.stop(asked)
    run.run()
    recorder.close(ended_by=run.ended_by(EndReason.TIME_LIMIT))

    record = load_record(tmp_path / "record")
    tally, watched = RunTally(), ReportWatch(record)
    again = run_of(record, tally, replay(record, Observers((tally, watched))))
    last = joined(record, watched, again, [])["frames"][-1]
    assert again.result.differences == [] and last["state"] == "ended"
    assert last["line"] == f"{line}: 0 of 1 targets reached"
