"""What is said in the end of a state that could not be kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.checkpoint.checkpointer import Checkpointer, StateUpdate
from companion.checkpoint.state_directory import StateDirectoryError
from companion.checkpoint.state_format import MapPart, SavedProgress
from companion.checkpoint.state_writer import StateFile
from companion.cli.inputs import OutputError
from companion.cli.state import RunState, StateFiles
from companion.storage.files import OsDisk
from tests.support.rig import yard
from tests.support.states import a_state, leave_state


def test_a_state_that_is_older_than_the_run_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_state = RunState(yard(tmp_path), tmp_path / "state", resume=False, say=lambda _: None)
    with_state.start()
    assert (with_state.problem, with_state.way_on) == ("", ""), "nothing is saved yet"
    monkeypatch.setattr(StateFile, "is_saved", True)
    assert with_state.way_on.endswith("the same command with --resume")
    monkeypatch.setattr(Checkpointer, "problem", "mission.state: the state cannot be saved: No space left on device")
    assert with_state.way_on == ""
    assert with_state.problem.endswith("; make room there or name another place with --state DIR")
    assert with_state.file is not None
    with_state.file.write_bytes(b"as it was")
    assert "do not --resume: mission.state is older than this run" in with_state.problem
    with_state.close()


def test_a_place_that_cannot_be_used_is_refused_only_where_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = yard(tmp_path)
    nowhere = tmp_path / "yard.toml" / "state"
    with pytest.raises(StateDirectoryError, match="choose another place with --state DIR"):
        RunState(mission, nowhere, resume=False, say=print)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "yard.toml"))
    with pytest.raises(StateDirectoryError, match="no state can be kept here"):
        RunState(mission, None, resume=True, say=print)
    said: list[str] = []
    keeping = RunState(mission, None, resume=False, say=said.append)
    keeping.start()
    keeping.close()
    assert keeping.checkpointer is None and len(said) == 1 and said[0].endswith("this run cannot be resumed")


@pytest.mark.parametrize("resume", [False, True])
def test_a_run_that_never_began_leaves_the_older_state_alone(tmp_path: Path, resume: bool) -> None:
    """And there is something to go on with only for who has resumed it."""
    mission = yard(tmp_path)
    leave_state(tmp_path, mission).close()
    keeping = RunState(mission, tmp_path / "state", resume=resume, say=print)
    keeping.start()
    keeping.close()
    assert (keeping.previous is not None) is resume
    assert keeping.way_on.endswith("the same command with --resume") is resume
    assert sorted(path.name for path in (tmp_path / "state").iterdir()) == ["lock", "mission.state"]


def test_a_state_file_keeps_the_older_state_when_the_first_rows_come(tmp_path: Path) -> None:
    path, before = tmp_path / "mission.state", tmp_path / "mission.state.before"
    path.write_bytes(b"older")
    file = StateFile(path, OsDisk(), before)
    assert path.exists() and not file.is_saved
    for _ in range(2):
        file.apply(StateUpdate({MapPart("log_odds", 0, 1, 0, 4): np.zeros((1, 4), dtype=np.float32)}))
    assert not path.exists() and before.read_bytes() == b"older"


def test_a_newer_part_of_the_same_rows_takes_the_place_of_the_older_one(tmp_path: Path) -> None:
    file, encoded = StateFile(tmp_path / "mission.state", OsDisk()), []
    for columns in (2, 4):
        part = MapPart("log_odds", 0, 1, 0, columns), MapPart("log_odds", 1, 1, 0, columns)
        file.apply(StateUpdate({one: np.full((1, columns), columns, np.float32) for one in part}))
        encoded.append(sorted(one.columns for one, _ in file._parts.values()))
    assert encoded == [[2, 2], [4, 4]]


def test_a_mission_that_has_ended_is_told_and_not_driven_again(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    values = {**a_state().progress.model_dump(), "statuses": ["reached"], "phase": "done", "index": 1}
    progress = SavedProgress.model_validate(values)
    leave_state(tmp_path, mission, ended=True, progress=progress).close()
    said: list[str] = []
    keeping = RunState(mission, tmp_path / "state", resume=True, say=said.append)
    assert keeping.ended and keeping.statuses == [("gate", "reached")]
    assert said == ["Yard was driven to its end: 1 of 1 targets reached", "to drive it again, start without --resume"]
    keeping.close()


def test_a_folder_that_cannot_be_made_is_told_as_it_was_given() -> None:
    with pytest.raises(OutputError, match=r"^/proc/none: cannot be written: .*; choose another place$"):
        StateFiles(Path("/proc/none"))


def test_of_a_run_that_never_began_no_empty_folders_stay(tmp_path: Path) -> None:
    StateFiles(tmp_path / "rover" / "state").close()
    assert list(tmp_path.iterdir()) == []
    files = StateFiles(tmp_path / "rover" / "state")
    (tmp_path / "rover" / "state" / "mission.state").touch()
    files.close()
    assert (tmp_path / "rover" / "state" / "mission.state").exists()
