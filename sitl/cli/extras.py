"""Libraries that only some users install: what is missing is told before the work, not after it."""

from __future__ import annotations

from importlib.util import find_spec


def statistics_fault(what: str) -> str:
    """Why the intervals of ``what`` cannot be computed here, and the remedy; empty if they can."""
    if find_spec("scipy") is not None:
        return ""
    return f"{what}: its statistics need scipy; install rover-companion[experiments]"


def parquet_fault() -> str:
    """Why ``--parquet`` cannot be written here, and the remedy; empty if it can."""
    if find_spec("pyarrow") is not None:
        return ""
    return "--parquet: pyarrow is not installed; install rover-companion[parquet], or leave the option out"
