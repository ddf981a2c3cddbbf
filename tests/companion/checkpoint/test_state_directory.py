"""The directory of states: what is taken up, what is refused, and what people are told of it."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError, default_directory
from companion.checkpoint.state_format import MAGIC, SavedProgress, encode_state
from companion.cli.keeping import Keeping
from companion.mission.identity import fingerprint
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.storage.disk import OsDisk, replace_file
from tests.support.rig import yard
from tests.support.states import a_state, sealed


def left(folder: Path, mission: Mission, **changes: object) -> StateDirectory:
    """A state of the mission, as a run has left it."""
    place = StateDirectory(folder / "state")
    state = a_state(**{"mission_sha256": fingerprint(mission), **changes})
    replace_file(OsDisk(), place.file, encode_state(state, {}))
    return place


def refused(place: StateDirectory, mission: Mission) -> str:
    with pytest.raises(StateDirectoryError) as caught:
        place.load(mission)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_the_state_of_this_mission_is_found(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    found = left(tmp_path, mission).load(mission)
    assert found is not None and found.state.mission == "Yard"


def test_nothing_there_is_no_fault(tmp_path: Path) -> None:
    assert StateDirectory(tmp_path / "new" / "state").load(yard(tmp_path)) is None


def test_another_missions_state_is_refused_and_left_where_it_is(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = left(tmp_path, mission)
    other = yard(tmp_path, '[[target]]\nname = "gate"\nfield = [16, 7]\n')
    said = refused(place, other)
    assert str(place.file) in said and "another mission ('Yard', 0 of 1 targets reached)" in said and "--resume" in said
    assert place.load(mission) is not None


@pytest.mark.parametrize("data", [b"", b"rubbish", sealed(MAGIC + b"1\n")], ids=["empty", "rubbish", "forged"])
def test_a_damaged_state_is_refused_kept_aside_and_named(tmp_path: Path, data: bytes) -> None:
    mission = yard(tmp_path)
    place = left(tmp_path, mission)
    place.file.write_bytes(data)
    said = refused(place, mission)
    assert str(place.file) in said and "kept as mission.state.damaged;" in said
    assert place.file.with_name("mission.state.damaged").read_bytes() == data
    assert place.load(mission) is None, "the next start begins at the first target"


def test_a_file_too_large_for_a_state_is_not_even_read(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = left(tmp_path, mission)
    with place.file.open("r+b") as file:
        file.truncate(10**10)  # takes no room on the disk
    assert "larger than any state" in refused(place, mission)


def test_a_state_of_another_version_stays(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = left(tmp_path, mission)
    place.file.write_bytes(sealed(MAGIC + b"9\nnew things"))
    assert "format '9', this program reads 1" in refused(place, mission)
    assert place.file.exists()


def test_what_is_left_of_a_write_that_was_cut_is_cleared_away(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = left(tmp_path, mission)
    place.close()
    (tmp_path / "state" / "mission.state.new").write_bytes(b"half a st")
    assert StateDirectory(tmp_path / "state").load(mission) is not None
    assert sorted(path.name for path in (tmp_path / "state").iterdir()) == ["lock", "mission.state"]


def test_one_directory_is_for_one_run_at_a_time(tmp_path: Path) -> None:
    place = StateDirectory(tmp_path)
    with pytest.raises(StateDirectoryError, match="another run keeps its state here; stop it, or use --state"):
        StateDirectory(tmp_path)
    place.close()
    StateDirectory(tmp_path).close()


def test_a_run_that_was_killed_keeps_nobody_out(tmp_path: Path) -> None:
    code = f"import os, pathlib; from companion.checkpoint.state_directory import StateDirectory; StateDirectory(pathlib.Path({str(tmp_path)!r})); os.abort()"
    assert subprocess.run([sys.executable, "-c", code], timeout=60, check=False).returncode < 0
    StateDirectory(tmp_path).close()


def test_a_place_that_cannot_be_used_is_refused_only_where_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = yard(tmp_path)
    nowhere = tmp_path / "yard.toml" / "state"
    with pytest.raises(StateDirectoryError, match="choose another place with --state DIR"):
        Keeping(mission, nowhere, resume=False, say=print)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "yard.toml"))
    with pytest.raises(StateDirectoryError, match="no state can be kept here"):
        Keeping(mission, None, resume=True, say=print)
    said: list[str] = []
    keeping = Keeping(mission, None, resume=False, say=said.append)
    keeping.start()
    keeping.close()
    assert keeping.checkpointer is None and len(said) == 1 and said[0].endswith("this run cannot be resumed")


def test_without_resume_a_mission_begins_anew_and_the_state_before_is_kept(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    left(tmp_path, mission).close()
    keeping = Keeping(mission, tmp_path / "state", resume=False, say=print)
    assert keeping.previous is None
    keeping.close()
    assert sorted(path.name for path in (tmp_path / "state").iterdir()) == ["lock", "mission.state.before"]


def test_a_mission_that_has_ended_is_told_and_not_driven_again(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    values = {**a_state().progress.model_dump(), "statuses": ["reached"], "leg": "done", "index": 1}
    progress = SavedProgress.model_validate(values)
    left(tmp_path, mission, ended=True, progress=progress).close()
    said: list[str] = []
    keeping = Keeping(mission, tmp_path / "state", resume=True, say=said.append)
    assert keeping.ended and keeping.statuses == [("gate", "reached")]
    assert said == ["Yard was driven to its end: 1 of 1 targets reached", "to drive it again, start without --resume"]
    keeping.close()


def test_where_states_are_kept() -> None:
    home = {"HOME": "/home/pi"}
    assert default_directory(home) == Path("/home/pi/.local/state/rover-companion")
    assert default_directory({**home, "XDG_STATE_HOME": "/var/x"}) == Path("/var/x/rover-companion")
    assert default_directory({**home, "XDG_STATE_HOME": "not/absolute"}) == default_directory(home)
    assert default_directory({**home, "STATE_DIRECTORY": "/var/lib/rover:/var/lib/more"}) == Path("/var/lib/rover")


def test_missions_are_the_same_wherever_they_lie_and_different_wherever_they_lead(tmp_path: Path) -> None:
    (tmp_path / "copy").mkdir()
    first, second = yard(tmp_path), yard(tmp_path / "copy")
    assert fingerprint(first) == fingerprint(second)
    assert second.source is not None
    second.source.write_text("# a remark\n" + second.source.read_text())
    assert fingerprint(load_mission(second.source)) == fingerprint(first)
    others = [
        replace(first, targets=(replace(first.targets[0], hold_s=1.0),)),
        replace(first, rover=replace(first.rover, radius_m=0.4)),
        replace(first, prior_map=tmp_path / "yard.png"),
    ]
    assert len({fingerprint(mission) for mission in (first, *others)}) == 4
    with_map = fingerprint(others[2])
    (tmp_path / "yard.png").write_bytes(b"changed")
    assert fingerprint(others[2]) != with_map
    (tmp_path / "yard.png").unlink()
    with pytest.raises(MissionError, match=r"prior_map: .*yard\.png: cannot be read"):
        fingerprint(others[2])
