"""The directory of a state: what is loaded, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError, default_directory
from companion.checkpoint.state_format import MAGIC
from companion.mission.mission import Mission
from tests.support.forked import Forked
from tests.support.rig import yard
from tests.support.states import leave_state, sealed


def refused(place: StateDirectory, mission: Mission) -> str:
    with pytest.raises(StateDirectoryError) as caught:
        place.load(mission)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_the_state_of_this_mission_is_found(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    found = leave_state(tmp_path, mission).load(mission)
    assert found is not None and found.state.mission == "Yard"


def test_nothing_there_is_no_fault(tmp_path: Path) -> None:
    assert StateDirectory(tmp_path / "new" / "state").load(yard(tmp_path)) is None


def test_another_missions_state_is_refused_and_left_where_it_is(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = leave_state(tmp_path, mission)
    other = yard(tmp_path, '[[target]]\nname = "gate"\nfield = [16, 7]\n')
    said = refused(place, other)
    assert str(place.file) in said and "another mission ('Yard', 0 of 1 targets reached)" in said and "--resume" in said
    assert place.load(mission) is not None


@pytest.mark.parametrize("data", [b"", b"rubbish", sealed(MAGIC + b"4\n")], ids=["empty", "rubbish", "forged"])
def test_a_damaged_state_is_refused_kept_aside_and_named(tmp_path: Path, data: bytes) -> None:
    mission = yard(tmp_path)
    place = leave_state(tmp_path, mission)
    place.file.write_bytes(data)
    said = refused(place, mission)
    assert str(place.file) in said and "kept as mission.state.damaged;" in said
    assert place.file.with_name("mission.state.damaged").read_bytes() == data
    assert place.load(mission) is None, "the next start begins at the first target"


def test_a_file_too_large_for_a_state_is_not_even_read(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = leave_state(tmp_path, mission)
    with place.file.open("r+b") as file:
        file.truncate(10**10)  # takes no room on the disk
    assert "larger than any state" in refused(place, mission)


def test_a_state_of_another_version_stays(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = leave_state(tmp_path, mission)
    place.file.write_bytes(sealed(MAGIC + b"9\nnew things"))
    assert "format '9', this program reads 4" in refused(place, mission)
    assert place.file.exists()


def test_what_is_left_of_a_write_that_was_cut_is_cleared_away(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    place = leave_state(tmp_path, mission)
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
    killed = (
        "import os, pathlib\n"
        "from companion.checkpoint.state_directory import StateDirectory\n"
        f"place = StateDirectory(pathlib.Path({str(tmp_path)!r}))\n"
        "os.abort()"
    )
    with Forked("companion", (), first=killed) as child:
        assert child.wait(60.0) < 0
    StateDirectory(tmp_path).close()


def test_where_states_are_kept() -> None:
    home = {"HOME": "/home/pi"}
    assert default_directory(home) == Path("/home/pi/.local/state/rover-companion")
    assert default_directory({**home, "XDG_STATE_HOME": "/var/x"}) == Path("/var/x/rover-companion")
    assert default_directory({**home, "XDG_STATE_HOME": "not/absolute"}) == default_directory(home)
    assert default_directory({**home, "STATE_DIRECTORY": "/var/lib/rover:/var/lib/more"}) == Path("/var/lib/rover")
