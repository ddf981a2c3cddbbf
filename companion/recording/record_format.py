"""The format of a record: names of its files, ``meta.json``, rounds as bytes, decisions as JSON (docs/record.md).

Nouns: round.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from companion.navigation.field_step import Decision
from companion.settings import Settings

FORMAT = 3
"""Of the whole directory. A reader refuses others."""
META, MISSION, PACKETS, ROUNDS, DECISIONS = "meta.json", "mission.json", "link.tlog", "rounds.bin", "decisions.jsonl"
INPUTS = "inputs"
STATE = "state"
"""The kind of the input file that an interrupted run has left."""
STAMP = struct.Struct(">Q")
"""Before each packet in ``link.tlog``: microseconds since 1970, as ground stations write it."""
ROUND = struct.Struct("<dIII")
CHECKED_ROUND = struct.Struct("<dIIII")


class RecordError(Exception):
    """A record that cannot be written or read; the text is one line with the place, the reason and the remedy."""


class InputFile(BaseModel):
    """A file that was copied. ``name``: its path in the record, with slashes; ``source``: where it was."""

    kind: str
    name: str
    source: str
    sha256: str


class FileLength(BaseModel):
    """Length and check sum of a file when the record was closed."""

    bytes: int
    crc32: int


class RecordMeta(BaseModel):
    """``meta.json``. ``end``: by file name; None until the record is closed."""

    model_config = ConfigDict(extra="ignore")

    format: int
    mission: str | None = None
    seed: int
    arm: bool
    settings: dict[str, object]
    settings_sha256: str
    run_sha256: str
    start_unix_us: int = 0
    versions: dict[str, str]
    inputs: list[InputFile]
    end: dict[str, FileLength] | None


class Round(NamedTuple):
    """One round of the companion: it listened, and acted.

    ``time_s``: the companion's clock. ``heard``, ``said``: number of packets in the packet log, first those heard.
    ``marks``: bits of Mark.
    """

    time_s: float
    heard: int = 0
    said: int = 0
    marks: int = 0


def packed_round(entry: Round) -> bytes:
    """The 24 bytes in the file. Each round has its own check sum, so that a torn or damaged one is noticed."""
    data = ROUND.pack(*entry)
    return data + struct.pack("<I", zlib.crc32(data))


def unpacked_rounds(data: bytes) -> tuple[list[Round], int]:
    """The rounds of a file up to the first that is torn or damaged, and the number of bytes they take."""
    rounds: list[Round] = []
    for *values, check in CHECKED_ROUND.iter_unpack(data[: len(data) - len(data) % CHECKED_ROUND.size]):
        found = Round(*values)
        if zlib.crc32(ROUND.pack(*found)) != check:
            break
        rounds.append(found)
    return rounds, len(rounds) * CHECKED_ROUND.size


def decision_line(time_s: float, target: str, decision: Decision) -> str:
    """A decision as one line of JSON."""
    return json.dumps(
        {
            "time_s": time_s,
            "target": target,
            "action": decision.action.value,
            "part": decision.part.value,
            "reason": decision.reason,
            "searches": [kind.value for kind in decision.searches],
            "proved": decision.proved,
            "new_path": decision.new_path is not None,
            "path": [[cell.x, cell.y] for cell in decision.path],
        }
    )


def settings_sum(settings: Settings) -> str:
    """SHA-256 of all settings."""
    return hashlib.sha256(json.dumps(settings.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def run_sum(seed: int, settings_sha256: str, *, arm: bool) -> str:
    """SHA-256 of the inputs of a run that are not files."""
    return hashlib.sha256(f"{seed} {arm} {settings_sha256}".encode()).hexdigest()
