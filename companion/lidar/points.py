"""What the decoders of all lidars give: points, and the counters of what could not be used.

A decoder takes bytes in blocks of any size and keeps incomplete packets for the next block. The same bytes give the
same points however they are cut. No bytes raise an error.

Nouns: points, decoder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Points:
    """Single readings in the order in which they were taken, each array of shape (n,).

    ``angle_deg``: from the sensor's own zero, growing as it turns, in [0, 360). ``range_m``: 0 where no echo came back.
    ``quality``: strength of the echo in the sensor's own unit, 0 where it tells none.
    """

    angle_deg: Floats
    range_m: Floats
    quality: Floats

    def __len__(self) -> int:
        """How many."""
        return len(self.angle_deg)


NO_POINTS = Points(np.empty(0), np.empty(0), np.empty(0))


def joined(parts: list[Points]) -> Points:
    """All points of several blocks."""
    if not parts:
        return NO_POINTS
    return Points(
        np.concatenate([one.angle_deg for one in parts]),
        np.concatenate([one.range_m for one in parts]),
        np.concatenate([one.quality for one in parts]),
    )


def next_header(buffer: bytes, header: bytes, at: int) -> int:
    """Where the next packet begins, or where the rest begins that may hold the first byte of a header of two."""
    begin = buffer.find(header, at)
    return begin if begin >= 0 else max(len(buffer) - (buffer[-1:] == header[:1]), at)


class Decoder(Protocol):
    """Decodes the bytes of one lidar."""

    bad_bytes: int
    """Bytes that belonged to no valid packet."""
    clock_ms: int | None
    """What the sensor's own clock told last; None: it has none."""

    def feed(self, data: bytes) -> Points:
        """The points completed by these bytes."""
        ...
