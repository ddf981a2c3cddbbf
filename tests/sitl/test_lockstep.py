"""A drive in lock-step: interrupted in the middle of a tick, what it says of the rover, how long it drove."""

from __future__ import annotations

import os
import signal
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from companion.mission.load import load_mission
from companion.recording.reader import load_record
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import EndReason
from companion.settings import Settings, parse_settings
from sitl.cli.drive_outputs import print_summary
from sitl.lockstep import Drive
from sitl.scenario import simulated

MISSION = Path(__file__).resolve().parents[2] / "missions" / "open.toml"


class InterruptedRecorder(Recorder):
    """Ctrl-C while the companion is sending."""

    whole: int | None = None
    """Packets that were said whole since then; None before it."""

    def said(self, time_s: float, raw: bytes) -> None:
        if self.whole is None and time_s > 5.0:
            self.whole = 0
            os.kill(os.getpid(), signal.SIGINT)
        super().said(time_s, raw)
        if self.whole is not None:
            self.whole += 1


def test_the_record_of_an_interrupted_drive_ends_with_a_whole_tick(tmp_path: Path) -> None:
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        mission = load_mission(MISSION)
        recorder = InterruptedRecorder(tmp_path / "run", mission, Settings(), 0, arm=True, start_us=0)
        drive = Drive(mission, simulated(mission, None), Settings(), 0, recorder)
        with pytest.raises(KeyboardInterrupt):
            drive.run()
    finally:
        signal.signal(signal.SIGINT, earlier)
    assert recorder.whole and drive.simulator.time_s < 7.0
    recorder.close(ended_by=EndReason.STOPPED_BY_USER)
    record = load_record(tmp_path / "run")
    assert record.complete and record.meta.end_reason is EndReason.STOPPED_BY_USER
    assert len(list(record.ticks())) > 50 and record.notes == []


def test_a_drive_says_how_the_rover_followed_where_motions_were_planned() -> None:
    mission = load_mission(MISSION)
    texts = []
    for controller in ("motion-ga", "points"):
        settings = parse_settings({"guidance": {"controller": controller}}, "here")
        drive = Drive(mission, simulated(mission, None), settings, 0, NullRecorder(), time_limit_s=60.0)
        console = Console(file=StringIO(), width=120)
        print_summary(drive.run(), console)
        texts.append(console.file.getvalue())  # type: ignore[attr-defined]
    assert "follows" in texts[0] and "m/s²" in texts[0]
    assert "follows" not in texts[1]


def test_the_driving_time_is_from_the_first_movement_to_the_last_to_within_a_tick() -> None:
    mission = load_mission(MISSION)
    drive = Drive(mission, simulated(mission, None), Settings(), 0, NullRecorder(), time_limit_s=60.0)
    moves_s: list[float] = []
    advance_to_s, before_m = drive.simulator.advance_to_s, 0.0

    def watched(time_s: float) -> None:
        nonlocal before_m
        advance_to_s(time_s)
        if drive.simulator.driven_m > before_m:
            moves_s.append(drive.simulator.time_s)
        before_m = drive.simulator.driven_m

    drive.simulator.advance_to_s = watched  # type: ignore[method-assign]
    report = drive.run()
    tick_s = 1.0 / drive.settings.link.tick_hz
    assert moves_s and report.driving_time_s == pytest.approx(moves_s[-1] - moves_s[0], abs=2.0 * tick_s)
