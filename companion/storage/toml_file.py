"""TOML files read and validated: whatever is wrong becomes one line that names file, place and remedy.

Nouns: TOML.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar, get_args

from pydantic import BaseModel, ValidationError

from companion.storage.files import open_file

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
        return tomllib.loads(data.decode("utf-8"))
    except OSError as fault:
        if missing_ok and isinstance(fault, FileNotFoundError):
            return {}
        raise error(f"{path}: cannot be read: {fault.strerror}; {name_it}") from fault
    except UnicodeDecodeError as fault:
        raise error(f"{path}: not UTF-8 text (byte {fault.start}); save it as UTF-8") from fault
    except tomllib.TOMLDecodeError as fault:
        raise error(f"{path}: not valid TOML: {' '.join(str(fault).split())}{end}") from fault
    except RecursionError as fault:
        raise error(f"{path}: not valid TOML: nested too deeply{end}") from fault
    except ValueError as fault:  # a number of thousands of digits
        raise error(f"{path}: not valid TOML: {str(fault)[:80]}{end}") from fault


def read_table(path: Path, model: type[Model], error: type[Exception], remedy: str = "") -> Model:
    """A whole TOML file as one table. Raises ``error``: one line with file, place, reason and remedy."""
    try:
        return model.model_validate(read_toml(path, error, remedy=remedy))
    except ValidationError as fault:
        reason = _counted(describe_first(fault, model))
        raise error(f"{path}: {reason}{remedy and f'; {remedy}'}") from fault


def describe_first(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a validation in one line: place and reason.

    For an unknown key, also the nearest known key, or all.
    """
    # Quoted keys may hold any character.
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in _described(error, model))


def alike(name: str, known: Iterable[str]) -> str:
    """The known name with nearly the same spelling as ``name``; empty if there is none.

    The first letter is rarely wrong: if it differs, the rest must match better.
    """
    for near in difflib.get_close_matches(name, known):
        if near[0] == name[0] or difflib.SequenceMatcher(None, near, name).ratio() >= 0.75:
            return near
    return ""


def _described(error: ValidationError, model: type[BaseModel]) -> str:
    fault = error.errors(include_url=False)[0]
    place = ".".join(str(key) for key in fault["loc"]) or "file"
    if fault["type"] == "missing":
        return f"{place}: field required, it is missing"
    if fault["type"] == "value_error":
        return f"{place}: {fault['msg'].removeprefix('Value error, ')}"
    if fault["type"] != "extra_forbidden":
        return f"{place}: {fault['msg'].lower()} (got {fault.get('input')!r:.60})"
    known = _known_keys(model, fault["loc"][:-1])
    near = alike(str(fault["loc"][-1]), known)
    hint = f", did you mean '{near}'?" if near else f"; known here: {', '.join(known)}"
    return f"{place}: unknown key{hint}"


def _known_keys(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """The keys of the model at a place; looks through lists and optional values."""
    for key in place:
        field = model.model_fields.get(str(key))
        if field is not None:
            inside = (field.annotation, *get_args(field.annotation))
            model = next((kind for kind in inside if isinstance(kind, type) and issubclass(kind, BaseModel)), model)
    return list(model.model_fields)


def _counted(fault: str) -> str:
    """Counts tables from 1: ``target.0.hold_s: ...`` becomes ``target 1.hold_s: ...``."""
    place, colon, reason = " ".join(fault.split()).partition(": ")
    return re.sub(r"\.(\d+)", lambda found: f" {int(found[1]) + 1}", place) + colon + reason
