"""The files a run follows from, copied into its record, so that it can be run again when they have changed or gone."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from companion.mission.files import files_of
from companion.mission.mission import Mission
from companion.storage.reading import open_file, refuse_pipe

INPUTS = "inputs"


class RecordError(Exception):
    """A record that cannot be begun or read; the text is one line with the place, the reason and the remedy."""


class Copied(NamedTuple):
    """A file in the record. ``name``: from the record's directory, with slashes; ``source``: where it was."""

    kind: str
    name: str
    source: str
    sha256: str


def copied(directory: Path, mission: Mission | None, files: Mapping[str, Path | None]) -> list[Copied]:
    """Copy all files of a mission, in the folders they have to each other, and the others by their kind. Raises OSError."""
    entries: list[Copied] = []
    own = () if mission is None else files_of(mission)
    together = os.path.commonpath([os.path.dirname(os.path.abspath(path)) for path in own]) if own else ""
    for path in own:
        place = Path(INPUTS, "mission", os.path.relpath(path, together))
        entries.append(_copy(directory, "mission file", place, path))
    for kind, given in files.items():
        if given is not None:
            entries.append(_copy(directory, kind, Path(INPUTS, kind, given.name), given))
    return entries


def in_record(entries: list[Copied], source: Path) -> str:
    """The name in the record of a file that has been copied; itself, if it was not there to be copied."""
    return next((entry.name for entry in entries if entry.source == str(source)), str(source))


def _copy(directory: Path, kind: str, place: Path, path: Path) -> Copied:
    with open_file(path) as file:
        data = file.read()
    (directory / place).parent.mkdir(parents=True, exist_ok=True)
    refuse_pipe(directory / place)
    (directory / place).write_bytes(data)
    return Copied(kind, place.as_posix(), str(path), hashlib.sha256(data).hexdigest())
