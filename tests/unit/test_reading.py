"""Files that people name and that are none: a pipe nobody writes into, a device without end, a file larger than any memory."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.mission.load import load_mission
from companion.reading import open_file, read_at_most
from companion.settings import Settings, SettingsError, load_settings
from companion.state.place import StatePlace, StatePlaceError
from companion.tuning import with_tuned
from sitl.fault_file import FaultFileError, load_faults
from sitl.paramfile import MOST_BYTES, ParameterFileError, load_parameters
from tests.rig import yard

HUGE = 3_000_000_000


def load_state(path: Path) -> None:
    StatePlace(path.parent).load(load_mission(path.parent / "yard.toml"))


READERS: dict[str, tuple[Callable[[Path], object], type[Exception]]] = {
    "settings": (load_settings, SettingsError),
    "tuned.toml": (lambda path: with_tuned(Settings(), path), SettingsError),
    "mission.state": (load_state, StatePlaceError),
    "faults": (load_faults, FaultFileError),
    "params": (load_parameters, ParameterFileError),
}


@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", READERS)
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path, name: str) -> None:
    yard(tmp_path)
    os.mkfifo(tmp_path / name)
    read, error = READERS[name]
    with pytest.raises(error, match=f"{name}: .*not a file") as caught:
        read(tmp_path / name)
    assert "\n" not in str(caught.value) and ";" in str(caught.value)  # a reason and a remedy


@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", ["settings", "faults", "params"])
def test_a_device_without_end_is_refused(name: str) -> None:
    read, error = READERS[name]
    with pytest.raises(error, match=r"/dev/zero: .*not a file"):
        read(Path("/dev/zero"))


def test_no_more_than_may_be_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(HUGE)
    monkeypatch.setattr(Path, "read_bytes", lambda _: pytest.fail("all of it has been read"))
    with pytest.raises(ParameterFileError, match=f"more than {MOST_BYTES} bytes"):
        load_parameters(path)
    with pytest.raises(OSError, match="larger than 10 bytes"):
        read_at_most(path, 10)


def test_files_are_read_and_folders_are_not(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"words")
    with open_file(tmp_path / "file") as file:
        assert file.read() == b"words"
    assert read_at_most(tmp_path / "file", 5) == b"words"
    with pytest.raises(IsADirectoryError):
        open_file(tmp_path)


@pytest.mark.timeout(60)
def test_a_record_of_pipes_is_not_replayed(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "meta.json")
    result = CliRunner().invoke(app, ["replay", str(tmp_path)])
    assert result.exit_code == 2 and "meta.json: cannot be read: not a file" in result.output
