"""Messages between a run, its web process and browsers: JSON and map tiles, each with its length before it on the pipe.

Imports nothing heavy: the web process lives beside the drive on a small computer.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping
from typing import IO

HEAD = struct.Struct("<cI")
JSON, TILES = b"J", b"T"
MOST_BYTES = 64 * 1024 * 1024
"""A longer message is damage."""
NOBODY_DRIVES: Mapping[str, object] = {"drives": "nobody", "path": [], "motion": None, "setpoint": None}
"""Parts of the last frame of a run that has ended otherwise than by itself."""


def packed(kind: bytes, payload: bytes) -> bytes:
    """A message as it goes over the pipe."""
    return HEAD.pack(kind, len(payload)) + payload


def read_message(pipe: IO[bytes]) -> tuple[bytes, bytes] | None:
    """The next message, its kind and its payload; None at the end. Raises ValueError for one that is damaged."""
    head = pipe.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    kind, size = HEAD.unpack(head)
    if kind not in (JSON, TILES) or size > MOST_BYTES:
        raise ValueError("damaged message")
    payload = pipe.read(size)
    return None if len(payload) < size else (kind, payload)


TILE_MAGIC, TILE_HEAD = b"TIL1", struct.Struct("<HHH")
Place = tuple[int, int]
"""Column and row of a tile, from the map's south-west corner."""


def tile_message(tiles: Iterable[tuple[Place, bytes]]) -> bytes:
    """The binary message of some tiles: column, row and length of each as 16-bit numbers, then its cells in runs."""
    return TILE_MAGIC + b"".join(TILE_HEAD.pack(*place, len(runs)) + runs for place, runs in tiles)


def tiles_in(message: bytes) -> Iterator[tuple[Place, bytes]]:
    """The tiles of a message."""
    at = len(TILE_MAGIC)
    while at < len(message):
        column, row, length = TILE_HEAD.unpack_from(message, at)
        at += TILE_HEAD.size
        yield (column, row), message[at : at + length]
        at += length
