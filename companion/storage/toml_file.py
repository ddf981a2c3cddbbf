"""TOML files read and validated: whatever is wrong becomes one line that names file, place and remedy.

Nouns: TOML.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from companion.storage.files import open_file
from companion.storage.validation import describe_first

MAX_BYTES = 5_000_000
Model = TypeVar("Model", bound=BaseModel)


def read_toml(
    path: Path,
    error: type[Exception],
    *,
    remedy: str = "",
    name_it: str = "check the path",
    limit: int = MAX_BYTES,
    missing_ok: bool = False,
) -> dict[str, object]:
    """The content of a TOML file. Raises ``error``: one line with file, place, reason and remedy.

    ``remedy``: where the format is described; ``name_it``: what to do when the file cannot be opened. ``limit``: its
    size in bytes. With ``missing_ok`` a file that does not exist is empty.
    """
    end = remedy and f"; {remedy}"
    try:
        with open_file(path) as file:
            data = file.read(limit + 1)
        if len(data) > limit:
            raise error(f"{path}: larger than {limit} bytes; a short TOML file is expected")
        return tomllib.loads(data.decode("utf-8-sig"))  # editors on Windows begin a file with a mark
    except OSError as fault:
        if missing_ok and isinstance(fault, FileNotFoundError):
            return {}
        raise error(f"{path}: cannot be read: {fault.strerror}; {name_it}") from fault
    except UnicodeDecodeError as fault:
        raise error(f"{path}: not UTF-8 text (byte {fault.start}); save it as UTF-8") from fault
    except tomllib.TOMLDecodeError as fault:
        hint = _decimal_comma(data.decode("utf-8-sig"), str(fault))
        raise error(f"{path}: not valid TOML: {' '.join(str(fault).split())}{hint}{end}") from fault
    except RecursionError as fault:
        raise error(f"{path}: not valid TOML: nested too deeply{end}") from fault
    except ValueError as fault:  # a number of thousands of digits
        raise error(f"{path}: not valid TOML: {str(fault)[:80]}{end}") from fault


def _decimal_comma(text: str, fault: str) -> str:
    """What to add where the line has a number with a comma; empty elsewhere."""
    line, lines = re.search(r"at line (\d+)", fault), text.splitlines()
    place = int(line[1]) - 1 if line else len(lines)
    found = re.search(r"=\s*([+-]?\d+),(\d+)\s*(#.*)?$", lines[place]) if place < len(lines) else None
    return f"; write {found[1]}.{found[2]} with a point, not with a comma" if found else ""


def read_table(path: Path, model: type[Model], error: type[Exception], remedy: str = "") -> Model:
    """A whole TOML file as one table. Raises ``error``: one line with file, place, reason and remedy."""
    try:
        return model.model_validate(read_toml(path, error, remedy=remedy))
    except ValidationError as fault:
        reason = _counted(describe_first(fault, model))
        raise error(f"{path}: {reason}{remedy and f'; {remedy}'}") from fault


def _counted(fault: str) -> str:
    """Counts tables from 1: ``target.0.hold_s: ...`` becomes ``target 1.hold_s: ...``."""
    place, colon, reason = " ".join(fault.split()).partition(": ")
    return re.sub(r"\.(\d+)", lambda found: f" {int(found[1]) + 1}", place) + colon + reason
