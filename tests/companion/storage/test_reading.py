"""Files that people name and that are none: a pipe nobody writes into, a device without end, a file larger than any memory."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.checkpoint.state_directory import StateDirectory, StateDirectoryError
from companion.cli.commands import app
from companion.cli.inputs import OutputError
from companion.cli.state import StateFiles
from companion.core.clock import WallClock
from companion.core.frames import GeoPoint, LocalFrame
from companion.mavlink.byte_link import LinkError
from companion.mavlink.serial_port import SerialLink
from companion.mavlink.signing import SigningKeyError, load_key
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.resolve import resolve
from companion.settings import Settings, SettingsError, load_settings
from companion.settings.tunable_parameters import with_tuned
from companion.storage.reading import open_file, read_at_most, why_no_file
from sitl.cli.commands import app as sitl
from sitl.faults.fault_file import FaultFileError, load_faults
from sitl.firmware.parameter_files import MOST_BYTES, ParameterFileError, load_parameters
from tests.support.rig import yard

HUGE = 3_000_000_000


def load_state(path: Path) -> None:
    StateDirectory(path.parent).load(load_mission(path.parent / "yard.toml"))


READERS: dict[str, tuple[Callable[[Path], object], type[Exception]]] = {
    "settings": (load_settings, SettingsError),
    "tuned.toml": (lambda path: with_tuned(Settings(), path), SettingsError),
    "mission.state": (load_state, StateDirectoryError),
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


def test_why_something_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    assert why_no_file(tmp_path / "file") == ""
    assert why_no_file(tmp_path / "pipe") == "not a file; name one"
    assert why_no_file(tmp_path) == "is a folder, not a file; add a file's name"
    for name in ("none", "file/none", "no\0ne"):
        assert why_no_file(tmp_path / name) == "no such file; check the path"


def test_a_folder_is_no_mission(tmp_path: Path) -> None:
    (tmp_path / "m.toml").mkdir()
    with pytest.raises(MissionError, match=r"m\.toml: is a folder, not a file; add a file's name"):
        load_mission(tmp_path / "m.toml")


@pytest.mark.parametrize("key", ["prior_map", "sitl.world"])
@pytest.mark.parametrize("what", ["folder", "pipe"])
def test_what_a_mission_names_and_is_no_file(tmp_path: Path, key: str, what: str) -> None:
    yard(tmp_path)
    (tmp_path / "map.png").mkdir() if what == "folder" else os.mkfifo(tmp_path / "map.png")
    mission = tmp_path / "yard.toml"
    text = mission.read_text()
    mission.write_text(text.replace("yard.png", "map.png") if key == "sitl.world" else f'prior_map = "map.png"\n{text}')
    with pytest.raises(MissionError, match=rf"{key}: .*map.png: .*not a file; \w") as caught:
        load_mission(mission)
    assert "no such file" not in str(caught.value)


@pytest.mark.parametrize("name", ["driving", "dead-companion"])
def test_an_experiment_names_the_folder_that_was_given(tmp_path: Path, name: str) -> None:
    for folder, reason in ((tmp_path / "none", "no such folder of maps"), (tmp_path, "open.toml does not lie beside")):
        result = CliRunner().invoke(sitl, ["experiment", name, "--runs", "1", "--maps", str(folder)])
        assert result.exit_code == 2 and result.stderr.startswith(f"{folder}: {reason}")
        assert "missions/maps of the source" in result.stderr and len(result.stderr.splitlines()) == 1


def far(folder: Path) -> None:
    mission = load_mission(Path(__file__).parents[3] / "missions" / "field.waypoints")
    lay = GeoPoint(0.0, 0.0)
    resolve(mission, LocalFrame(lay), LocalFrame(lay).to_ned(lay))


def state_is_a_folder(folder: Path) -> None:
    yard(folder)
    (folder / "mission.state").mkdir()
    load_state(folder / "mission.state")


def state_is_a_file(folder: Path) -> None:
    (folder / "file").touch()
    StateFiles(folder / "file")


REMEDIES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a state that is a file": (state_is_a_file, "file: is a file; --state takes a directory"),
    "a state that is a folder": (state_is_a_folder, "Is a directory; remove it, or start without --resume"),
    "no serial port": (lambda folder: SerialLink("/etc/passwd", 57600, WallClock()), "it is no serial port; see `ls"),
    "a folder for a port": (
        lambda folder: SerialLink(str(folder), 57600, WallClock()),
        ": cannot be opened: it is a directory, no serial port; see `ls /dev/tty*`",
    ),
    "no key": (lambda folder: load_key(folder / "nokey"), "No such file or directory; name a file with the passphrase"),
    "settings in a folder": (load_settings, "Is a directory; name a TOML file, or leave --settings out"),
    "a mission that says no resolution": (far, "If they are, write a TOML mission with a larger resolution_m"),
}


@pytest.mark.parametrize("what", REMEDIES)
def test_what_cannot_be_used_is_told_with_a_remedy(tmp_path: Path, what: str) -> None:
    use, words = REMEDIES[what]
    with pytest.raises(
        (OutputError, StateDirectoryError, LinkError, SigningKeyError, SettingsError, MissionError)
    ) as caught:
        use(tmp_path)
    assert words in str(caught.value) and "\n" not in str(caught.value)
