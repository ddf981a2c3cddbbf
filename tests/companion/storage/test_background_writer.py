"""Background threads: what they write, and how long the end of the program waits for them in all."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.checkpoint.state_writer import StateFile, StateUpdate, ThreadStateWriter
from companion.core.tick_marks import Mark
from companion.recording.reader import load_record
from companion.recording.recorder import MAX_UNWRITTEN_BYTES, Recorder
from companion.settings import Settings
from companion.storage.background_writer import BackgroundWorker, BackgroundWriter, ShutdownBudget
from companion.storage.files import OsDisk
from tests.support.notices import HandClock
from tests.support.rig import yard


class Slow(threading.Thread):
    """Ends after so long of a clock that only its ``join`` moves."""

    def __init__(self, clock: HandClock, takes_s: float) -> None:
        super().__init__()
        self.clock, self.left_s = clock, takes_s

    def join(self, timeout: float | None = None) -> None:
        assert timeout is not None
        waited_s = min(timeout, self.left_s)
        self.left_s -= waited_s
        self.clock.time_s += waited_s

    def is_alive(self) -> bool:
        return self.left_s > 0.0


@pytest.mark.parametrize(
    ("takes_s", "ended", "waited_s"),
    [
        ([0.1, 0.1], [True, True], 0.2),
        ([0.25, 9.0, 0.1], [True, False, False], 0.5),
        ([9.0, 9.0, 9.0, 9.0], [False, False, False, False], 0.5),
    ],
)
def test_all_who_wait_for_a_disk_have_half_a_second_together(
    takes_s: list[float], ended: list[bool], waited_s: float
) -> None:
    clock = HandClock()
    budget = ShutdownBudget(clock=clock)
    assert [budget.wait(Slow(clock, each)) for each in takes_s] == ended
    assert clock.time_s == pytest.approx(waited_s)


def test_a_run_that_ends_by_itself_has_more_time() -> None:
    clock = HandClock()
    budget = ShutdownBudget(clock=clock)
    budget.extend(10.0)
    assert budget.wait(Slow(clock, 10.2))
    assert not budget.wait(Slow(clock, 0.4))


class NoBudget(ShutdownBudget):
    """Counts the waits."""

    asked = 0

    def wait(self, thread: threading.Thread) -> bool:
        self.asked += 1
        return not thread.is_alive()


class HangingDisk(OsDisk):
    """One that takes a file and never says that it has it, until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()

    def sync(self, handle: int) -> None:
        self.free.wait(30.0)


@pytest.fixture
def hanging() -> Iterator[HangingDisk]:
    disk = HangingDisk()
    yield disk
    disk.free.set()


def test_state_settings_and_record_wait_with_one_budget(tmp_path: Path, hanging: HangingDisk) -> None:
    budget = NoBudget()
    saver = BackgroundWriter(hanging, budget)
    saver.save(tmp_path / "tuned.toml", b"new")
    writer = ThreadStateWriter(StateFile(tmp_path / "state", hanging), budget)
    writer.put(StateUpdate())
    recorder = Recorder(tmp_path / "run", None, Settings(), 0, worker=BackgroundWorker("record", budget))
    for part in (saver, writer, recorder):
        part.close()
    assert budget.asked == 3


def test_a_state_that_is_not_saved_in_time_is_told(tmp_path: Path, hanging: HangingDisk) -> None:
    file = StateFile(tmp_path / "state", hanging)
    writer = ThreadStateWriter(file, ShutdownBudget(0.01))
    file.apply = lambda update: hanging.sync(0)  # type: ignore[method-assign]
    writer.put(StateUpdate())
    assert writer.problem == ""
    writer.close()
    assert writer.problem == f"{tmp_path / 'state'}: the state is not saved yet: the disk does not answer"


def test_a_disk_that_hangs_does_not_keep_the_record_from_being_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, free = threading.Event(), threading.Event()
    mission = yard(tmp_path)
    worker = BackgroundWorker("record", ShutdownBudget(0.01))
    recorder = Recorder(tmp_path / "run", mission, Settings(), 0, worker=worker)
    monkeypatch.setattr("os.fsync", lambda handle: free.wait(30.0))
    recorder.begin(0.0, Mark.BEGIN)
    recorder.heard(1.0, [])
    recorder.heard(2.0, [])
    worker.put(written.set)
    assert written.wait(30.0)
    recorder.close()
    assert recorder.problem == f"{tmp_path / 'run'}: the record has ended: the disk does not answer"
    record = load_record(tmp_path / "run")
    assert not record.complete and any("was not closed" in note for note in record.notes)
    free.set()
    worker.close()


def test_a_disk_that_hangs_for_minutes_ends_the_record_before_the_memory(tmp_path: Path) -> None:
    free = threading.Event()
    worker = BackgroundWorker("record", ShutdownBudget(0.01))
    worker.put(lambda: bool(free.wait(30.0)) and None)
    recorder = Recorder(tmp_path / "run", None, Settings(), 0, worker=worker)
    recorder.begin(0.0, Mark.BEGIN)
    for second in range(1, 30):
        recorder.said(float(second), bytes(MAX_UNWRITTEN_BYTES // 20))
        assert (recorder.problem == "") == (second <= 20), second
        recorder.heard(float(second), [])
    free.set()
    recorder.close()
    assert (tmp_path / "run" / "link.tlog").stat().st_size <= MAX_UNWRITTEN_BYTES


def test_with_a_thread_the_record_is_the_same(tmp_path: Path) -> None:
    written = []
    for name, worker in (("at-once", None), ("beside", BackgroundWorker("record", ShutdownBudget(30.0)))):
        recorder = Recorder(tmp_path / name, None, Settings(), 0, start_us=0, worker=worker)
        for tick in range(100):
            recorder.heard(0.1 * tick, [bytes([tick])])
            recorder.said(0.1 * tick, b"said")
        recorder.close()
        written.append({path.name: path.read_bytes() for path in recorder.directory.iterdir()})
        assert recorder.problem == ""
    assert written[0] == written[1]


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "tuned.toml"
    path.write_bytes(b"old")

    def broken(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", broken)
    saver = BackgroundWriter()
    saver.save(path, b"new")
    saver.close()
    assert path.read_bytes() == b"old"
    assert saver.problem == f"{path}: cannot be written: No space left on device"


def test_the_newest_of_many_is_what_stays(tmp_path: Path) -> None:
    saver, path, other = BackgroundWriter(), tmp_path / "a", tmp_path / "b"
    for number in range(200):
        saver.save(path, str(number).encode())
    saver.save(other, b"too")
    saver.close()
    assert (path.read_bytes(), other.read_bytes()) == (b"199", b"too")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a", "b"]


def test_a_disk_that_hangs_keeps_nobody_from_ending(tmp_path: Path) -> None:
    disk = HangingDisk()
    saver = BackgroundWriter(disk, ShutdownBudget(0.01))
    saver.save(tmp_path / "tuned.toml", b"new")
    writers = [thread for thread in threading.enumerate() if thread.name == "saver"]
    saver.close()
    saver.close()
    still = [thread for thread in writers if thread.is_alive()]
    assert still and all(thread.daemon for thread in still), (
        "a thread that is no daemon is waited for at the program's end"
    )
    assert saver.problem == f"{tmp_path / 'tuned.toml'}: not written yet: the disk does not answer"
    disk.free.set()
