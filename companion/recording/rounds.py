"""The rounds file of a record: for each round of the loop its time, its packets and its marks, with a checksum.

A run follows from its inputs: files, settings, seed, the packets received, and these rounds. An entry takes 24 bytes,
about 2 MB an hour. Each has its own checksum, so that a torn or damaged entry is detected.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

ENTRY = struct.Struct("<dIII")
CHECKED = struct.Struct("<dIIII")


class Round(NamedTuple):
    """One round of the loop.

    ``time_s``: the companion's clock. ``heard`` and ``said``: how many packets of the packet log were received and then
    sent. ``marks``: the sum of its ``core.round_marks.Mark``.
    """

    time_s: float
    heard: int = 0
    said: int = 0
    marks: int = 0

    def packed(self) -> bytes:
        """The entry in the file."""
        entry = ENTRY.pack(*self)
        return entry + struct.pack("<I", zlib.crc32(entry))


def unpacked(data: bytes) -> tuple[list[Round], int]:
    """The rounds of a file before the first torn or damaged entry, and the bytes they take."""
    rounds: list[Round] = []
    for *values, check in CHECKED.iter_unpack(data[: len(data) - len(data) % CHECKED.size]):
        found = Round(*values)
        if zlib.crc32(ENTRY.pack(*found)) != check:
            break
        rounds.append(found)
    return rounds, len(rounds) * CHECKED.size
