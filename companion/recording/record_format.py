"""The format of a record: names of its files, ``meta.json``, ticks as bytes, decisions as JSON (docs/record.md).

Nouns: tick entry.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from companion.navigation.field_step import Decision
from companion.safety.reasons import EndReason

FORMAT, WITH_LIDARS = 3, 4
"""Of the whole directory, without and with lidars on the companion's own ports. A reader refuses others."""
META, MISSION, PACKETS, TICKS, DECISIONS = "meta.json", "mission.json", "link.tlog", "rounds.bin", "decisions.jsonl"
LIDARS = "lidars.bin"
"""What lidars on the companion's own ports have sent; there only if there were any."""
INPUTS = "inputs"
STATE = "state"
"""The kind of the input file that an interrupted run has left."""
STAMP = struct.Struct(">Q")
"""Before each packet in ``link.tlog``: microseconds since 1970, as ground stations write it."""
TICK = struct.Struct("<dIII")
CHECKED_TICK = struct.Struct("<dIIII")
LIDAR_HEAD = struct.Struct("<IdBII")
"""Before the bytes in ``lidars.bin``: number of the tick, time by the companion's clock, number of the lidar, how many
bytes, and their check sum."""


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
    """``meta.json``. ``end``: by file name; None until the record is closed. ``lidars``: as they were given.

    ``ended_by``: why a simulated drive ended, or who stopped a run, by the name of the reason; empty: not known.
    """

    model_config = ConfigDict(extra="ignore")

    format: int
    mission: str | None = None
    seed: int
    arm: bool
    settings: dict[str, object]
    settings_sha256: str
    run_sha256: str
    lidars: list[str] = []
    start_unix_us: int = 0
    versions: dict[str, str]
    inputs: list[InputFile]
    end: dict[str, FileLength] | None
    ended_by: str = ""

    @property
    def end_reason(self) -> EndReason | None:
        """Why a simulated drive ended, or who stopped a run. None: the run itself tells it."""
        return EndReason.__members__.get(self.ended_by)


class LidarEntry(NamedTuple):
    """Bytes of a lidar. ``tick``: in which they were read, from 0; ``number``: of the lidar, from 1."""

    tick: int
    time_s: float
    number: int
    data: bytes


class TickEntry(NamedTuple):
    """One tick in the record: the companion listened, and acted.

    ``time_s``: the companion's clock. ``heard``, ``said``: number of packets in the packet log, first those heard.
    ``marks``: bits of Mark.
    """

    time_s: float
    heard: int = 0
    said: int = 0
    marks: int = 0


def packed_tick(entry: TickEntry) -> bytes:
    """The 24 bytes in the file. Each tick has its own check sum, so that a torn or damaged one is noticed."""
    data = TICK.pack(*entry)
    return data + struct.pack("<I", zlib.crc32(data))


def unpacked_ticks(data: bytes) -> tuple[list[TickEntry], int]:
    """The ticks of a file up to the first that is torn or damaged, and the number of bytes they take."""
    ticks: list[TickEntry] = []
    for *values, check in CHECKED_TICK.iter_unpack(data[: len(data) - len(data) % CHECKED_TICK.size]):
        found = TickEntry(*values)
        if zlib.crc32(TICK.pack(*found)) != check:
            break
        ticks.append(found)
    return ticks, len(ticks) * CHECKED_TICK.size


def packed_lidar(entry: LidarEntry) -> bytes:
    """As it stands in the file."""
    head = entry.tick, entry.time_s, entry.number, len(entry.data), zlib.crc32(entry.data)
    return LIDAR_HEAD.pack(*head) + entry.data


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


def settings_sum(settings: Mapping[str, object]) -> str:
    """SHA-256 of all settings, as they stand in ``meta.json``."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def run_sum(seed: int, settings_sha256: str, lidars: Sequence[str] = (), *, arm: bool) -> str:
    """SHA-256 of the inputs of a run that are not files."""
    given = "".join(f" {one}" for one in lidars)
    return hashlib.sha256(f"{seed} {arm} {settings_sha256}{given}".encode()).hexdigest()
