"""The rounds of a record: when the companion listened, how much it heard and said, and what came to it from outside meanwhile.

A run follows from its inputs: files, settings, seed, the bytes it heard, and these. One entry of 24 bytes a round, so about 2 MB
an hour; each has a check sum of its own, so that a torn or damaged entry is noticed.
"""

from __future__ import annotations

import struct
import zlib
from enum import IntFlag
from typing import NamedTuple

ENTRY = struct.Struct("<dIII")
CHECKED = struct.Struct("<dIIII")


class Mark(IntFlag):
    """What happened in a round beyond bytes."""

    BEGIN = 1
    """The companion was made; nothing was heard."""
    ANSWER = 2
    """The answer of the navigator's step was taken, which a thread had computed."""
    STOP = 4
    """A person's wish to end the run was heeded."""
    CLOSE = 8
    """The run was broken off by an error, and the way out began; nothing was heard."""
    WORKING = 16
    """The thread was still computing a step."""
    SIGNED = 32
    """The run believed signed packets only; those that it refused are not recorded."""
    UNSIGNED = 64
    """Some were refused by now because they were not signed,"""
    WRONG = 128
    """signed with another key,"""
    OLD = 256
    """or signed too long ago, or heard again."""
    UNSAVED = 512
    """The state of the run could not be saved the last time."""


class Round(NamedTuple):
    """``time_s``: the companion's clock; ``heard`` and ``said``: packets of the packet log, first those heard."""

    time_s: float
    heard: int = 0
    said: int = 0
    marks: int = 0

    def packed(self) -> bytes:
        """The entry in the file."""
        entry = ENTRY.pack(*self)
        return entry + struct.pack("<I", zlib.crc32(entry))


def unpacked(data: bytes) -> tuple[list[Round], int]:
    """The rounds of a file up to the first entry that is torn or damaged, and the bytes they take."""
    rounds: list[Round] = []
    for *values, check in CHECKED.iter_unpack(data[: len(data) - len(data) % CHECKED.size]):
        found = Round(*values)
        if zlib.crc32(ENTRY.pack(*found)) != check:
            break
        rounds.append(found)
    return rounds, len(rounds) * CHECKED.size
