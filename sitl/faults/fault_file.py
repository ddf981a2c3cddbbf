"""Fault plans: read from TOML, every key checked, every mistake told in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from companion.settings import alike, describe_first
from companion.storage.reading import open_file
from sitl.faults.plan import Fault, FaultPlan
from sitl.faults.tables import KINDS, PlanTable

MAX_BYTES = 1_000_000


class FaultFileError(Exception):
    """A plan that cannot be used; the text is one line with file, place, reason and remedy."""


def load_faults(path: Path) -> FaultPlan:
    """Read a plan. Raises FaultFileError: one line with file, place, reason and remedy."""
    try:
        with open_file(path) as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise FaultFileError(f"{path}: larger than {MAX_BYTES} bytes; a fault plan is a short TOML file")
        table = PlanTable.model_validate(tomllib.loads(data.decode("utf-8")))
    except OSError as error:
        raise FaultFileError(f"{path}: cannot be read: {error.strerror}; check the path") from error
    except UnicodeDecodeError as error:
        raise FaultFileError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        reason = " ".join(str(error).split()) if isinstance(error, tomllib.TOMLDecodeError) else "nested too deeply"
        raise FaultFileError(f"{path}: not valid TOML: {reason}; docs/faults.md has examples") from error
    except ValidationError as error:
        reason = " ".join(describe_first(error, PlanTable).split())
        tables = error.errors(include_url=False)[0]["loc"][:1] == ("fault",)
        remedy = "write one [[fault]] table for each fault" if tables else "docs/faults.md describes the file"
        raise FaultFileError(f"{path}: {reason}; {remedy}") from error
    if not table.fault:
        raise FaultFileError(f"{path}: fault: there is none; write one [[fault]] table for each fault")
    faults = tuple(_fault(path, number, one) for number, one in enumerate(table.fault, 1))
    return FaultPlan(faults, table.seed, str(path))


def _fault(path: Path, number: int, table: dict[str, Any]) -> Fault:
    """One ``[[fault]]`` table, counted from 1 as people count."""
    kind = table.get("kind")
    model = KINDS.get(kind) if isinstance(kind, str) else None
    if model is None:
        near = alike(str(kind), list(KINDS))
        said = "kind: missing" if kind is None else f"kind: unknown kind {kind!r:.40}"
        said += f", did you mean '{near}'?" if near else ""
        raise FaultFileError(f"{path}: fault {number}: {said}; kinds are {', '.join(KINDS)}")
    try:
        return model.model_validate(table).fault()
    except ValidationError as error:
        reason = " ".join(describe_first(error, model).split())
        raise FaultFileError(f"{path}: fault {number} ({kind}): {reason}; docs/faults.md lists its keys") from error
    except ValueError as error:
        raise FaultFileError(f"{path}: fault {number} ({kind}): {error}") from error
