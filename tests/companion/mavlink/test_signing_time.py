"""The file that keeps the signing timestamp."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from companion.mavlink.signing import LAST_TICK, Signer, SigningKeyError, ticks_now
from companion.mavlink.signing_time import TimeFile
from companion.storage.background_writer import BackgroundWriter

KEY = bytes(range(32))
TIME = 40_000_000_000_000


def test_the_time_file(tmp_path: Path) -> None:
    path, saver = tmp_path / "state" / "signing-time", BackgroundWriter()
    file = TimeFile(path, saver)
    assert file.saved == 0
    file.save(TIME)
    saver.close()
    assert file.saved == TIME == TimeFile(path, BackgroundWriter()).saved
    assert abs(ticks_now() - TIME) < 1e5 * 3600 * 24 * 365 * 30  # of this century


@given(st.binary(max_size=70))
def test_any_bytes_for_a_time_file_are_a_time_or_one_line(tmp_path_factory: Any, data: bytes) -> None:
    path = tmp_path_factory.mktemp("state") / "signing-time"
    path.write_bytes(data)
    try:
        assert 0 <= TimeFile(path, BackgroundWriter()).saved <= LAST_TICK
    except SigningKeyError as error:
        assert str(path) in str(error) and "\n" not in str(error)


def test_a_disk_that_is_full_does_not_silence_the_rover(tmp_path: Path) -> None:
    place = tmp_path / "file"
    place.write_text("in the way")
    saver = BackgroundWriter()
    file = TimeFile(tmp_path / "signing-time", saver)
    file._path = place / "signing-time"
    signer = Signer(KEY, lambda: TIME, file)
    signer.next_timestamp()
    saver.close()
    assert signer.next_timestamp() == TIME
    assert "cannot be written" in saver.problem
