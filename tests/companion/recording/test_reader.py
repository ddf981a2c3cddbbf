"""A record read back: complete, cut, or damaged."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.recording.reader import RecordedTick, load_record
from companion.recording.record_format import CHECKED_TICK, RecordError
from tests.support.quick import examples
from tests.support.records import (
    TICKS,
    Change,
    huge,
    linked,
    overwritten,
    removed,
    unclosed,
    with_flipped_bit,
    with_meta,
    write_record,
)

SEQUENCES = ("link.tlog", "rounds.bin", "decisions.jsonl")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_record(tmp_path_factory.mktemp("yard"))


@pytest.fixture
def copy(record: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(record, tmp_path / "copy"))


def read(record: Path) -> list[RecordedTick]:
    return list(load_record(record).ticks())


def test_all_that_was_recorded_is_read(record: Path) -> None:
    loaded = load_record(record)
    ticks = list(loaded.ticks())
    assert loaded.complete and loaded.notes == []
    assert (loaded.mission.name, loaded.meta.seed, loaded.meta.arm) == ("Yard", 0, True)
    assert len(ticks) == TICKS and len(loaded.decisions) == 9
    assert ticks[0].heard == ticks[0].said == []
    assert all(len(entry.heard) == 2 and len(entry.said) == 1 for entry in ticks[1:])


def test_the_state_that_a_resumed_run_writes_on_has_not_changed(copy: Path, tmp_path: Path) -> None:
    state, source = b"as it was", tmp_path / "mission.state"
    (copy / "inputs" / "mission.state").write_bytes(state)
    source.write_bytes(b"as the run left it")
    digest = hashlib.sha256(state).hexdigest()
    entry = {"kind": "state", "name": "inputs/mission.state", "source": str(source), "sha256": digest}
    meta = json.loads((copy / "meta.json").read_text())
    with_meta("inputs", [*meta["inputs"], entry])(copy)
    assert load_record(copy).notes == []


def test_a_file_that_changed_since_is_named_and_its_copy_used(copy: Path, tmp_path: Path) -> None:
    source = tmp_path / "yard.toml"
    source.write_text("name = 'another'\n")
    meta = json.loads((copy / "meta.json").read_text())
    inputs = [entry | {"source": str(source)} if entry["name"].endswith("toml") else entry for entry in meta["inputs"]]
    with_meta("inputs", inputs)(copy)
    loaded = load_record(copy)
    assert [note.partition(":")[0] for note in loaded.notes] == [str(source)]
    assert loaded.complete and loaded.mission.name == "Yard"


def test_other_versions_are_named(copy: Path) -> None:
    with_meta("versions", {"python": "2.7", "no longer used": "1"})(copy)
    (note,) = load_record(copy).notes
    assert "python 2.7" in note


def a_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("")


REFUSED: dict[str, tuple[Change, list[str]]] = {
    "mission changed": (with_flipped_bit("inputs/mission/yard.toml", 3), ["yard.toml", "changed since the run"]),
    "mission.json changed": (with_flipped_bit("mission.json", 30), ["mission.json", "changed since the run"]),
    "map gone": (removed("inputs/mission/yard.png"), ["yard.png", "cannot be read"]),
    "settings changed": (with_meta("settings", {"safety": {"stale_s": 2.0}}), ["meta.json", "settings changed"]),
    "older": (with_meta("format", 1), ["meta.json", "format 1", "formats 3 and 4"]),
    "newer": (with_meta("format", 99), ["format 99"]),
    "no json": (overwritten("meta.json", b"{"), ["meta.json", "damaged"]),
    "no object": (overwritten("meta.json", b"[]"), ["meta.json", "damaged"]),
    "zeros": (overwritten("meta.json", bytes(1000)), ["meta.json", "damaged"]),
    "a number": (overwritten("meta.json", b"0"), ["meta.json", "damaged"]),
    "seed changed": (with_meta("seed", 7), ["meta.json", "seed, arm or lidars changed"]),
    "arm changed": (with_meta("arm", False), ["meta.json", "seed, arm or lidars changed"]),
    "half": (overwritten("meta.json", b'{"format": 3}'), ["meta.json", "seed"]),
    "no name": (
        with_meta("inputs", [{"kind": "x", "name": "a\x7fb", "source": "", "sha256": ""}]),
        ["no name of a file"],
    ),
    "outside": (with_meta("inputs", [{"kind": "x", "name": "../x", "source": "", "sha256": ""}]), ["outside"]),
    "packets damaged": (with_flipped_bit("link.tlog", 5000), ["link.tlog", "damaged"]),
    "ticks damaged": (with_flipped_bit("rounds.bin", 500), ["rounds.bin", "damaged"]),
    "decisions damaged": (with_flipped_bit("decisions.jsonl", 500), ["decisions.jsonl", "damaged"]),
    "a file": (a_file, ["copy: is no directory; give the directory of a record"]),
    "nothing there": (shutil.rmtree, ["copy: no such directory", "give the directory of a record"]),
    "another directory": (removed("meta.json"), ["copy: is no record", "meta.json is missing"]),
    "no packets": (removed("link.tlog"), ["link.tlog", "cannot be read"]),
    "ticks huge": (huge("rounds.bin"), ["rounds.bin", "larger than"]),
    "decisions huge": (huge("decisions.jsonl"), ["decisions.jsonl", "larger than"]),
    "packets without end": (linked("link.tlog", "/dev/zero"), ["link.tlog", "not a file"]),
    "no ticks": (overwritten("rounds.bin", b""), ["rounds.bin", "no ticks"]),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_replayed_is_one_line(copy: Path, what: str) -> None:
    change, words = REFUSED[what]
    change(copy)
    with pytest.raises(RecordError) as refused:
        read(copy)
    line = str(refused.value)
    assert "\n" not in line and all(word in line for word in words), line


@pytest.mark.parametrize(("name", "at"), [("link.tlog", 5010), ("rounds.bin", 500)])
def test_damage_is_found_in_a_record_that_was_never_closed(copy: Path, name: str, at: int) -> None:
    unclosed(copy)
    with_flipped_bit(name, at)(copy)
    with pytest.raises(RecordError, match="damaged at byte"):
        read(copy)


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_record_that_is_cut_anywhere_is_read_as_far_as_it_goes(
    record: Path, tmp_path: Path, data: st.DataObject
) -> None:
    copy = tmp_path / "cut"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(record, copy)
    if data.draw(st.booleans(), "killed"):
        unclosed(copy)
    lengths = {}
    for name in SEQUENCES:
        size = (copy / name).stat().st_size
        lengths[name] = data.draw(st.integers(CHECKED_TICK.size if name == "rounds.bin" else 0, size - 1), name)
        with (copy / name).open("r+b") as file:
            file.truncate(lengths[name])
    loaded = load_record(copy)
    ticks, whole = list(loaded.ticks()), read(record)
    assert not loaded.complete
    assert loaded.notes and all("\n" not in note for note in loaded.notes)
    assert ticks == whole[: len(ticks)] and len(ticks) <= lengths["rounds.bin"] // CHECKED_TICK.size
    assert loaded.decisions == load_record(record).decisions[: len(loaded.decisions)]
