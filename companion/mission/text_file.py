"""The text of the files that ground stations write."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import MissionError
from companion.storage.reading import open_file


def read_text(path: Path, limit: int) -> str:
    """All of a text in UTF-8, with a byte order mark or without. Raises MissionError, also for more than ``limit`` bytes."""
    try:
        with open_file(path) as file:
            data = file.read(limit + 1)
    except OSError as error:
        raise MissionError(f"{path}: cannot be read: {error.strerror}; check the path") from error
    if len(data) > limit:
        raise MissionError(f"{path}: larger than {limit} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MissionError(f"{path}: not UTF-8 text (byte {error.start})") from error
