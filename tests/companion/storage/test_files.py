"""Files opened, read and replaced.

Power is lost after every step of a replacement, with everything that a disk may then lose.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.storage.files import (
    NEW_SUFFIX,
    OsDisk,
    open_file,
    read_at_most,
    replace_file,
    set_aside,
    whole_file,
    why_no_file,
)

HERE = Path("/d/state")


class PowerLostError(BaseException):
    """Nothing is cleaned up after this."""


class MortalDisk:
    """A disk in memory that loses its power before step ``last``. Only what has been synced is sure to stay."""

    def __init__(self, last: int, piece: int) -> None:
        self.files: dict[int, bytes] = {0: b"old" * 5}
        self.synced: dict[int, bytes] = dict(self.files)
        self.names: dict[Path, int] = {HERE: 0}
        self.synced_names: list[dict[Path, int]] = [dict(self.names)]
        self._last, self._piece, self._steps = last, piece, 0

    def _step(self) -> None:
        self._steps += 1
        if self._steps > self._last:
            raise PowerLostError

    def create(self, path: Path) -> int:
        self._step()
        handle = len(self.files)
        self.files[handle] = self.synced[handle] = b""
        self._name({**self.names, path: handle})
        return handle

    def write(self, handle: int, data: bytes) -> int:
        self._step()
        self.files[handle] += data[: self._piece]
        return len(data[: self._piece])

    def sync(self, handle: int) -> None:
        self._step()
        self.synced[handle] = self.files[handle]

    def close(self, handle: int) -> None:
        pass

    def rename(self, old: Path, new: Path) -> None:
        self._step()
        names = dict(self.names)
        names[new] = names.pop(old)
        self._name(names)

    def sync_directory(self, path: Path) -> None:
        self._step()
        self.synced_names = [self.names]

    def remove(self, path: Path) -> None:
        self._step()

    def _name(self, names: dict[Path, int]) -> None:
        self.names = names
        self.synced_names.append(names)

    def found(self) -> Iterator[bytes | None]:
        """What a loss of power may leave: any directory since the last sync, files cut or filled with zeros."""
        for names in self.synced_names:
            file = names.get(HERE)
            if file is None:
                yield None
                continue
            sure, whole = self.synced[file], self.files[file]
            for length in range(len(sure), len(whole) + 1):
                yield whole[:length]
                yield whole[:length] + bytes(len(whole) - length)


@pytest.mark.parametrize("piece", [1000, 7, 1])
def test_a_loss_of_power_at_any_step_leaves_the_old_file_or_the_new_one(piece: int) -> None:
    old, new = b"old" * 5, b"the new one"
    for last in range(100):
        disk = MortalDisk(last, piece)
        try:
            replace_file(disk, HERE, new)
        except PowerLostError:
            assert set(disk.found()) <= {old, new}, f"power lost before step {last + 1}"
            continue
        assert set(disk.found()) == {new}, "done means done"
        assert last >= 5
        return
    raise AssertionError("it never ended")


def test_the_model_of_a_disk_shows_what_not_syncing_costs() -> None:
    """The test above must be able to fail."""
    disk = MortalDisk(100, 4)
    handle = disk.create(HERE.with_name("beside"))
    disk.write(handle, b"the new one")
    disk.rename(HERE.with_name("beside"), HERE)
    assert {b"old" * 5, b"the ", b"th\0\0", b""} <= set(disk.found())


def test_a_full_disk_leaves_the_old_file_and_no_rubbish(tmp_path: Path) -> None:
    class FullDisk(OsDisk):
        def write(self, handle: int, data: bytes) -> int:
            super().write(handle, data[:3])
            raise OSError(28, "No space left on device")

    path = tmp_path / "state"
    replace_file(OsDisk(), path, b"old")
    with pytest.raises(OSError, match="No space left"):
        replace_file(FullDisk(), path, b"a new one")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["state"]
    replace_file(OsDisk(), path, b"a new one")
    assert path.read_bytes() == b"a new one" and not path.with_name("state" + NEW_SUFFIX).exists()
    assert path.stat().st_mode & 0o077 == 0


def test_what_is_set_aside_overwrites_nothing(tmp_path: Path) -> None:
    for number in range(3):
        (tmp_path / "state").write_text(str(number))
        set_aside(tmp_path / "state", "damaged")
    kept = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert kept == {"state.damaged": "0", "state.damaged-2": "1", "state.damaged-3": "2"}


def test_ordinary_files_are_read_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"words")
    with open_file(tmp_path / "file") as file:
        assert file.read() == b"words"
    assert read_at_most(tmp_path / "file", 5) == b"words"
    with pytest.raises(OSError, match="larger than 4 bytes"):
        read_at_most(tmp_path / "file", 4)
    with pytest.raises(IsADirectoryError):
        open_file(tmp_path)


@pytest.mark.timeout(60)
def test_a_device_without_end_is_refused() -> None:
    with pytest.raises(OSError, match="not a file"):
        open_file(Path("/dev/zero"))


def test_why_something_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    assert why_no_file(tmp_path / "file") == ""
    assert why_no_file(tmp_path / "pipe") == "not a file; name one"
    assert why_no_file(tmp_path) == "is a folder, not a file; add a file's name"
    for name in ("none", "file/none", "no\0ne"):
        assert why_no_file(tmp_path / name) == "no such file; check the path"


def test_a_pipe_under_the_name_of_the_new_file_fails_the_write(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "file.new")
    with pytest.raises(OSError, match="No such device"):
        replace_file(OsDisk(), tmp_path / "file", b"words")


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_file_that_was_not_written_to_its_end_leaves_the_old_one(tmp_path: Path, error: BaseException) -> None:
    file = tmp_path / "r.png"
    file.write_text("old")
    (tmp_path / ".r.new.png").write_text("of a program that was killed")
    with pytest.raises(type(error)), whole_file(file) as new:
        assert new.suffix == ".png" and not new.exists()
        new.write_text("half")
        raise error
    assert [one.name for one in tmp_path.iterdir()] == ["r.png"] and file.read_text() == "old"


def test_a_whole_file_takes_the_place_of_the_old_one_also_behind_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    file, link = tmp_path / "real" / "r.txt", tmp_path / "link.txt"
    link.symlink_to(file)
    for text in ("first", "second"):
        with whole_file(link) as new:
            new.write_text(text)
        assert link.is_symlink() and file.read_text() == text and [*file.parent.iterdir()] == [file]
    with whole_file(Path("/dev/null")) as new:
        assert new == Path("/dev/null")
