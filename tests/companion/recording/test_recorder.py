"""The record of a run, read back with other tools."""

import errno
import io
import json
from pathlib import Path

import pytest
from pymavlink import mavutil

from companion.core.tick_marks import Mark
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.mission.serialization import from_json
from companion.recording import recorder as recorder_module
from companion.recording.record_format import STAMP, RecordError, TickEntry, unpacked_ticks
from companion.recording.recorder import NullRecorder, Recorder
from companion.settings import Settings
from tests.support.mavlink_vehicle import Station
from tests.support.records import DECISION


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    file = tmp_path / "rooms.toml"
    file.write_text("name = 'rooms'\n[[target]]\nnorth_m = 5.0\neast_m = 0.0\n", encoding="utf-8")
    return load_mission(file)


def test_a_ground_stations_tools_read_the_packets(tmp_path: Path, mission: Mission) -> None:
    recorder = Recorder(tmp_path / "new" / "run", mission, Settings(), 7)
    rover, companion = Station(), Station(1, 191)
    for i in range(10):
        recorder.heard(100.0 + 0.5 * i, [rover.local_position(1000 + i, float(i))])
        recorder.said(100.0 + 0.5 * i, companion.heartbeat(kind=18, autopilot=8))
    recorder.close()
    log = mavutil.mavlink_connection(str(tmp_path / "new" / "run" / "link.tlog"))
    got = []
    while (message := log.recv_match()) is not None:
        got.append((message._timestamp, message.get_srcComponent(), message.get_type()))
    log.close()
    assert [entry[1:] for entry in got] == [(1, "LOCAL_POSITION_NED"), (191, "HEARTBEAT")] * 10
    assert got[0][0] > 1.6e9, "seconds since 1970"
    assert got[-1][0] - got[0][0] == pytest.approx(4.5, abs=1e-5)


def test_the_time_of_day_is_noted_when_the_first_tick_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unix_us = [1_795_650_000_000_000]
    monkeypatch.setattr(recorder_module, "unix_time_us", lambda: unix_us[0])
    recorder = Recorder(tmp_path / "run", None, Settings(), 0)
    unix_us[0] += 2_500_000  # so long the planner took to load
    recorder.begin(100.0, Mark.BEGIN)
    unix_us[0] += 400_000
    recorder.heard(100.25, [])
    recorder.said(100.25, Station().heartbeat())
    recorder.close()
    assert STAMP.unpack((tmp_path / "run" / "link.tlog").read_bytes()[:8])[0] == 1_795_650_002_750_000
    assert json.loads((tmp_path / "run" / "meta.json").read_text())["start_unix_us"] == 1_795_650_002_500_000


def test_decisions_and_what_it_was_run_with(tmp_path: Path, mission: Mission) -> None:
    recorder = Recorder(tmp_path / "run", mission, Settings(), 7)
    recorder.begin(12.25, Mark.BEGIN)
    recorder.write_decision(12.345678901, "east gate", DECISION)
    recorder.write_decision(13.0, "east gate", DECISION)
    recorder.close()
    first, second = (json.loads(line) for line in (tmp_path / "run" / "decisions.jsonl").read_text().splitlines())
    assert first["time_s"] == 12.345678901 and second["time_s"] == 13.0
    assert first | {"time_s": 0} == {
        "time_s": 0,
        "target": "east gate",
        "action": "follow",
        "part": "C",
        "reason": "current path blocked: new path",
        "searches": ["thorough"],
        "proved": False,
        "new_path": True,
        "path": [[0, 24], [1, 24]],
    }
    meta = json.loads((tmp_path / "run" / "meta.json").read_text())
    assert (meta["seed"], meta["mission"], meta["arm"]) == (7, "rooms", False)
    assert Settings.model_validate(meta["settings"]) == Settings()
    assert len(meta["settings_sha256"]) == 64 and set(meta["versions"]) >= {"python", "rover-companion", "numpy"}
    assert mission.source is not None
    assert (tmp_path / "run" / "inputs" / "mission" / "rooms.toml").read_bytes() == mission.source.read_bytes()
    assert from_json((tmp_path / "run" / "mission.json").read_bytes(), "") == mission


def test_it_is_on_disk_after_a_second_without_closing(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run", None, Settings(), 0)
    packet = Station().heartbeat()
    recorder.heard(0.0, [packet])
    recorder.heard(0.5, [packet])
    recorder.heard(1.5, [packet])
    assert (tmp_path / "run" / "link.tlog").stat().st_size == 3 * (8 + len(packet))
    assert unpacked_ticks((tmp_path / "run" / "rounds.bin").read_bytes())[0] == [TickEntry(0.0, 1), TickEntry(0.5, 1)]
    assert json.loads((tmp_path / "run" / "meta.json").read_text())["end"] is None
    recorder.close()


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path, mission: Mission) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RecordError) as caught:
        Recorder(tmp_path / "file" / "run", mission, Settings(), 0)
    assert str(caught.value).startswith(str(tmp_path / "file" / "run")) and "\n" not in str(caught.value)
    with pytest.raises(RecordError, match="choose a directory"):
        Recorder(tmp_path / "run", None, Settings(), 0, files={"settings": tmp_path / "none.toml"})


class FullDisk(io.BytesIO):
    """A file on a disk without room."""

    def write(self, data: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_ends_the_record_but_not_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(tmp_path / "run", None, Settings(), 0)
    recorder.begin(0.0, Mark.BEGIN)
    recorder.said(0.0, b"before")
    recorder.heard(1.0, [])
    recorder._files["decisions.jsonl"].close()
    monkeypatch.setitem(recorder._files, "decisions.jsonl", FullDisk())
    recorder.write_decision(1.1, "x", DECISION)
    recorder.heard(2.0, [])
    assert "No space left" in recorder.problem and str(tmp_path / "run") in recorder.problem
    recorder.heard(0.2, [b"packet"])
    recorder.write_decision(0.3, "x", DECISION)
    recorder.close()
    assert (tmp_path / "run" / "link.tlog").read_bytes().endswith(b"before")


def test_closing_twice_and_writing_after_is_harmless(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run", None, Settings(), 0)
    recorder.close()
    recorder.close()
    recorder.said(0.0, b"late")
    assert (tmp_path / "run" / "link.tlog").read_bytes() == b""
    assert recorder.problem == ""


def test_no_record_takes_everything() -> None:
    recorder = NullRecorder()
    recorder.heard(0.0, [b"x"])
    recorder.said(0.0, b"x")
    recorder.begin(0.0, Mark.BEGIN)
    recorder.mark(Mark.STOP)
    recorder.write_decision(0.0, "x", DECISION)
    recorder.close()
    assert recorder.problem == ""


def test_an_earlier_record_is_kept(tmp_path: Path, mission: Mission) -> None:
    places = []
    for seed in range(3):
        recorder = Recorder(tmp_path / "run", mission, Settings(), seed)
        recorder.close()
        places.append(recorder.directory)
    assert [place.name for place in places] == ["run", "run-2", "run-3"]
    assert [json.loads((place / "meta.json").read_text())["seed"] for place in places] == [0, 1, 2]
