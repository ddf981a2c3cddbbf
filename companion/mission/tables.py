"""What all our TOML files share: strict tables, the kinds of numbers in them, and one line for whatever is wrong."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from companion.settings import describe_first
from companion.storage.reading import open_file

MAX_BYTES = 5_000_000

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)

Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Index = Annotated[int, Field(ge=-1_000_000, le=1_000_000)]
Pair = Annotated[tuple[Metres, Metres], Field(strict=False)]
Field2 = Annotated[tuple[Index, Index], Field(strict=False)]
Lat = Annotated[float, Field(ge=-90.0, le=90.0)]
Lon = Annotated[float, Field(ge=-180.0, le=180.0)]
LatLon = Annotated[tuple[Lat, Lon], Field(strict=False)]
Positive = Annotated[float, Field(gt=0.0, le=1e6)]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f\u2028\u2029\x85]+$")]
FileName = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f]+$")]


class Table(BaseModel):
    """A TOML table: unknown keys, wrong types, inf and nan are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def read_table(path: Path, kind: type[M], error: type[Exception], remedy: str = "") -> M:
    """A whole TOML file as one table. Raises ``error``: one line with file, place and reason, and where it says what may stand there."""
    try:
        return kind.model_validate(read_toml(path, error, remedy))
    except ValidationError as fault:
        raise error(f"{path}: {_counted(describe_first(fault, kind))}{remedy and f'; {remedy}'}") from fault


def read_toml(path: Path, error: type[Exception], remedy: str = "") -> dict[str, object]:
    """What a TOML file says, whatever it is about. Raises ``error``: one line with file, place and reason."""
    try:
        with open_file(path) as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise error(f"{path}: larger than {MAX_BYTES} bytes; a short TOML file is expected")
        return tomllib.loads(data.decode("utf-8"))
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}; check the path") from fault
    except UnicodeDecodeError as fault:
        raise error(f"{path}: not UTF-8 text (byte {fault.start}); save it as UTF-8") from fault
    except tomllib.TOMLDecodeError as fault:
        raise error(f"{path}: not valid TOML: {fault}{remedy and f'; {remedy}'}") from fault
    except RecursionError as fault:
        raise error(f"{path}: not valid TOML: nested too deeply{remedy and f'; {remedy}'}") from fault
    except ValueError as fault:  # a number of thousands of digits
        raise error(f"{path}: not valid TOML: {str(fault)[:80]}{remedy and f'; {remedy}'}") from fault


def named(path: Path, kind: str, number: int, make: Callable[[], T], error: type[Exception]) -> T:
    """What ``make`` gives; its ValueError becomes ``error`` with file, kind of table and its number, from 1."""
    try:
        return make()
    except ValueError as fault:
        raise error(f"{path}: {kind} {number}: {fault}") from None


def _counted(fault: str) -> str:
    """People count tables from 1: ``target.0.hold_s: ...`` becomes ``target 1.hold_s: ...``."""
    place, colon, reason = " ".join(fault.split()).partition(": ")
    return re.sub(r"\.(\d+)", lambda found: f" {int(found[1]) + 1}", place) + colon + reason
