"""What a replay compares, and when it hands over what a thread had computed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.control import safe_reach
from companion.core import arrival_jitter
from companion.core.tick_marks import Mark
from companion.recording.reader import load_record
from companion.recording.record_format import packed_tick, unpacked_ticks
from companion.replay.replay import EndOfRecordError, RecordPlayer, ReplayStepRunner, replay
from companion.safety.reasons import EndReason
from tests.support.mavlink_vehicle import Station
from tests.support.records import DECISION, TICKS, unclosed, write_record
from tests.support.shared_data import SHARED, needs_shared


@pytest.fixture
def player(tmp_path: Path) -> RecordPlayer:
    return RecordPlayer(load_record(write_record(tmp_path)), lambda *_: None)


def play(player: RecordPlayer, until: int = TICKS) -> None:
    """Do what the recorded run did in its first ticks."""
    companion = Station(1, 191)
    for number in range(until):
        player.advance()
        time_s = player.now_s()
        if number:
            player.said(time_s, companion.heartbeat(kind=18, autopilot=8))
        if number and number % 20 == 0:
            player.write_decision(time_s, "gate", DECISION)


def test_the_same_run_has_no_differences(player: RecordPlayer) -> None:
    play(player)
    player.end()
    assert player.result.differences == []
    assert (player.result.ticks, player.result.said, player.result.decisions) == (TICKS, TICKS - 1, 9)
    assert player.result.seconds == pytest.approx(0.05 * (TICKS - 1))
    with pytest.raises(EndOfRecordError):
        player.advance()


def test_the_bytes_of_a_round_are_read_once(player: RecordPlayer) -> None:
    player.advance()
    assert player.read() == b""
    player.sleep_until_s(1000.0)
    assert player.now_s() == 0.05, "the recorded time, not the one that was asked for"
    assert len(player.read()) > 20 and player.read() == b""


def test_packets_that_differ_are_missing_or_come_too_many_are_told(player: RecordPlayer) -> None:
    play(player, 2)
    player.advance()
    player.said(0.1, Station(1, 191).heartbeat(kind=2))
    player.advance()
    player.advance()
    for _ in range(2):
        player.said(0.2, b"".join([Station(1, 191).heartbeat(kind=18, autopilot=8)]))
    player.advance()
    wrong, missing, numbering, too_many = player.result.differences
    assert wrong.startswith("0.10 s: said HEARTBEAT") and "in the run, not in the replay" in missing
    assert numbering.startswith("0.20 s: said HEARTBEAT") and "in the replay, not in the run" in too_many


def test_decisions_that_differ_or_are_missing_are_told(player: RecordPlayer) -> None:
    player.advance()
    player.write_decision(1.0, "gate", DECISION)
    player.write_decision(2.0, "gate", replace(DECISION, reason="another"))
    player.end()
    different, not_over, missing = player.result.differences
    assert (
        "decision 2" in different
        and "the run went on" in not_over
        and missing.endswith("7 recorded decisions are missing in the replay")
    )


def test_of_an_incomplete_record_the_last_decisions_and_packets_may_be_missing(tmp_path: Path) -> None:
    record = write_record(tmp_path)
    unclosed(record)
    decisions = (record / "decisions.jsonl").read_bytes().splitlines(keepends=True)
    (record / "decisions.jsonl").write_bytes(b"".join(decisions[:-2]))
    player = RecordPlayer(load_record(record), lambda *_: None)
    play(player)
    player.end()
    assert player.result.differences == []


def test_a_mark_that_the_run_did_not_have_is_told(player: RecordPlayer) -> None:
    player.advance()
    player.mark(Mark.BEGIN)
    assert player.result.differences == []
    player.mark(Mark.UNSAVED)
    (difference,) = player.result.differences
    assert "UNSAVED" in difference


def test_who_ended_a_run_is_known_also_where_its_record_was_not_closed(tmp_path: Path) -> None:
    record = write_record(tmp_path)
    ticks, _ = unpacked_ticks((record / "rounds.bin").read_bytes())
    marks = {1: Mark.STOP, 2: Mark.STOP | Mark.TERMINATED}
    changed = [entry._replace(marks=entry.marks | marks.get(number, 0)) for number, entry in enumerate(ticks)]
    (record / "rounds.bin").write_bytes(b"".join(packed_tick(entry) for entry in changed))
    unclosed(record)
    player = RecordPlayer(load_record(record), lambda *_: None)
    player.advance()
    assert player.stopped_by is EndReason.STOPPED_BY_USER
    player.advance()
    assert player.stopped_by is EndReason.TERMINATED
    player.mark(Mark.TERMINATED)
    assert player.result.differences == [], "older records lack this mark"


def test_an_answer_is_taken_in_the_round_in_which_the_run_took_it(tmp_path: Path) -> None:
    record = write_record(tmp_path)
    ticks, _ = unpacked_ticks((record / "rounds.bin").read_bytes())
    marks = {2: Mark.WORKING, 3: Mark.ANSWER}
    changed = [entry._replace(marks=entry.marks | marks.get(number, 0)) for number, entry in enumerate(ticks)]
    (record / "rounds.bin").write_bytes(b"".join(packed_tick(entry) for entry in changed))
    unclosed(record)
    player, started = RecordPlayer(load_record(record), lambda *_: None), []
    runner = ReplayStepRunner(player, lambda: started.append(player.entry.time_s))

    def failing() -> None:
        raise ZeroDivisionError

    taken = []
    for number in range(4):
        player.advance()
        if number == 1:
            runner.start(failing)  # type: ignore[arg-type]
        taken.append((runner.busy, runner.working))
        if number < 3:
            assert runner.take() is None
    assert started == [0.05] and taken == [(False, False), (True, False), (True, True), (True, False)]
    with pytest.raises(ZeroDivisionError):
        runner.take()
    assert not runner.busy and runner.take() is None


@pytest.mark.thorough
@needs_shared
def test_a_record_of_the_real_firmware_that_an_older_version_made_is_replayed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its settings have a key that is called otherwise today, and none for the rules that contacts have led to.

    Without those rules the same is decided until the map is another one: beams free less beside their middle now.
    Positions and ranges counted from when they came.
    """
    monkeypatch.setattr(safe_reach, "UNSURE_M", 0.0)
    monkeypatch.setattr(arrival_jitter, "MOST_S", 0.0)
    record = load_record(SHARED / "data" / "real-firmware" / "wall-end")
    assert "errand_reach_m" in str(record.meta.settings) and record.settings.safety.requested_goal_m == 300.0
    guidance = record.settings.guidance.model_copy(update={"swing_m_s2": 1e9, "held_overshoot_s": 0.0})
    result = replay(replace(record, settings=record.settings.model_copy(update={"guidance": guidance})))
    decided = [difference for difference in result.differences if ": decision " in difference]
    assert decided[0].startswith("30.70 s: decision 57: ")
    assert result.ticks > 3000 and result.decisions > 200
