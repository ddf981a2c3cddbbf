"""The state file: a line that names it, the length of its head, the head (JSON), the map in bands of rows, a checksum of all before.

Head and bands are deflated one by one. A file that has been cut, or in which a single byte is another one, is refused.
"""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from companion.checkpoint.model import SavedState

VERSION = 1
MAGIC = b"rover-companion state "
LENGTH = struct.Struct(">I")
SUM_BYTES = hashlib.sha256().digest_size
MAX_FILE_BYTES = 128_000_000
MAX_HEAD_BYTES = 64_000_000
LEVEL = 1
"""Of deflation: the quickest. A map is mostly one value, so that more effort saves little."""

Raster = NDArray[np.float32]


class StateError(Exception):
    """A state that cannot be used; the text says why, without the file's name."""


class DamagedError(StateError):
    """These bytes are not what was written."""


@dataclass(frozen=True, slots=True)
class BandPlace:
    """Which rows of which raster a band holds."""

    raster: str
    first_row: int
    rows: int


Bands = Mapping[BandPlace, bytes]
"""The map, deflated; the places of bands may not overlap."""


def deflated(rows: Raster) -> bytes:
    """A band of a raster, little-endian."""
    return zlib.compress(np.ascontiguousarray(rows, "<f4").tobytes(), LEVEL)


def encoded(state: SavedState, bands: Bands) -> bytes:
    """The whole file."""
    table = [(place.raster, place.first_row, place.rows, len(data)) for place, data in bands.items()]
    head = zlib.compress(json.dumps({"state": state.model_dump(mode="json"), "bands": table}).encode(), LEVEL)
    body = b"".join((MAGIC, b"%d\n" % VERSION, LENGTH.pack(len(head)), head, *bands.values()))
    return body + hashlib.sha256(body).digest()


def decoded(data: bytes) -> tuple[SavedState, dict[str, Raster]]:
    """State and rasters (``log_odds``, ``penalty``; zero where no band was). Raises DamagedError, or StateError for another version."""
    body, checksum = data[:-SUM_BYTES], data[-SUM_BYTES:]
    if len(data) < SUM_BYTES or hashlib.sha256(body).digest() != checksum:
        raise DamagedError("damaged (its checksum is wrong)")
    line, separator, rest = body.partition(b"\n")
    if not line.startswith(MAGIC) or not separator:
        raise DamagedError("no state of rover-companion")
    version = line[len(MAGIC) :]
    if version != b"%d" % VERSION:
        raise StateError(f"written in format {version[:20].decode('ascii', 'replace')!r}, this program reads {VERSION}")
    try:
        return _decoded(rest)
    except (ValueError, KeyError, TypeError, RecursionError, struct.error, zlib.error) as error:
        raise DamagedError(f"damaged ({_reason(error)})") from error


def _decoded(rest: bytes) -> tuple[SavedState, dict[str, Raster]]:
    length = LENGTH.unpack_from(rest)[0]
    start = LENGTH.size + length
    head = json.loads(_inflated(rest[LENGTH.size : start], MAX_HEAD_BYTES))
    if not isinstance(head, dict) or set(head) != {"state", "bands"} or not isinstance(head["bands"], list):
        raise ValueError("its head is not as it should be")
    state = SavedState.model_validate(head["state"])
    ground = state.ground
    fine = (ground.height * ground.subdivisions, ground.width * ground.subdivisions)
    rasters = {"log_odds": np.zeros(fine, np.float32), "penalty": np.zeros((ground.height, ground.width), np.float32)}
    for raster, first_row, rows, size in head["bands"]:
        _fill(rasters[raster], first_row, rows, rest[start : start + size])
        start += size
    if start != len(rest):
        raise ValueError("bytes left over")
    return state, rasters


def _fill(raster: Raster, first_row: int, rows: int, data: bytes) -> None:
    height, width = raster.shape
    if not (type(first_row) is type(rows) is int and 0 <= first_row < height and 0 < rows <= height - first_row):
        raise ValueError("a band lies outside the map")
    values = np.frombuffer(_inflated(data, rows * width * 4), "<f4")
    if not np.isfinite(values).all():
        raise ValueError("the map holds what are no numbers")
    raster[first_row : first_row + rows] = values.reshape(rows, width)


def _inflated(data: bytes, most: int) -> bytes:
    """Raises ValueError for what is cut or would be larger."""
    inflater = zlib.decompressobj()
    result = inflater.decompress(data, most + 1)  # one more, so that the end of what has just that size is seen
    if not inflater.eof or inflater.unused_data or len(result) > most:
        raise ValueError("a part of it is cut or too large")
    return result


def _reason(error: Exception) -> str:
    if isinstance(error, ValidationError):
        fault = error.errors(include_url=False)[0]
        return f"{'.'.join(str(part) for part in fault['loc'])}: {fault['msg'].lower()}"
    return str(error).splitlines()[0][:100] if str(error) else type(error).__name__
