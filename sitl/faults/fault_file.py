"""Reads fault plans from TOML files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from companion.storage.toml_file import read_table
from companion.storage.validation import alike, describe_first
from sitl.faults.plan import Fault, FaultPlan
from sitl.faults.tables import KINDS, PlanTable


class FaultFileError(Exception):
    """A plan that cannot be used; the text is one line with file, place, reason and remedy."""


def load_faults(path: Path) -> FaultPlan:
    """Read a plan. Raises FaultFileError: one line with file, place, reason and remedy."""
    table = read_table(path, PlanTable, FaultFileError, "docs/faults.md describes the file")
    if not table.fault:
        raise FaultFileError(f"{path}: fault: there is none; write one [[fault]] table for each fault")
    faults = tuple(fault_of(path, number, one) for number, one in enumerate(table.fault, 1))
    return FaultPlan(faults, table.seed, str(path))


def fault_of(path: Path | str, number: int, table: dict[str, Any]) -> Fault:
    """The fault of one ``[[fault]]`` table; ``number`` counts from 1."""
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
