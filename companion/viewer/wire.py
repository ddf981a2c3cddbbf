"""The pipe between a run and its web process: whole messages of JSON or bytes, each with its length before it.

Imports nothing heavy: the web process lives beside the drive on a small computer.
"""

from __future__ import annotations

import struct
from typing import IO

HEAD = struct.Struct("<cI")
JSON, TILES = b"J", b"T"
MOST_BYTES = 64 * 1024 * 1024
"""A longer message is damage."""


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
