"""The file that keeps the signing timestamp, so that it rises over restarts of program and computer."""

from __future__ import annotations

from pathlib import Path

from companion.mavlink.signing import LAST_TICK, SigningKeyError
from companion.storage.background_writer import BackgroundWriter
from companion.storage.files import open_file


class TimeFile:
    """Reads the file at once, writes it in a thread. Raises SigningKeyError if the file exists but cannot be used."""

    def __init__(self, path: Path, saver: BackgroundWriter) -> None:
        self._path = path
        self._saver = saver
        self.saved: float = _read(path)

    def save(self, timestamp: int) -> None:
        """Write it; ``saved`` follows when done, also after a failure: a full disk must not silence the rover."""

        def done() -> None:
            self.saved = timestamp

        self._saver.save(self._path, f"{timestamp}\n".encode(), done)


def _read(path: Path) -> int:
    remedy = "delete it if the computer's clock is right and was so before"
    try:
        with open_file(path) as file:
            text = file.read(64)
    except FileNotFoundError:
        return 0
    except OSError as error:
        raise SigningKeyError(f"{path}: cannot be read: {error.strerror or error}; make it readable") from error
    if not text.strip().isdigit() or not 0 <= int(text) <= LAST_TICK:
        raise SigningKeyError(f"{path}: not a signing timestamp; {remedy}")
    return int(text)
