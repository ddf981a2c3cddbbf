"""Libraries that only some users install: what is missing is told before the work, not after it."""

from __future__ import annotations

from importlib.util import find_spec

from companion.core.extras import not_installed


def statistics_fault(what: str) -> str:
    """Why the intervals of ``what`` cannot be computed here, and the remedy; empty if they can."""
    if find_spec("scipy") is not None:
        return ""
    return not_installed(f"{what}, its statistics", "experiments", "scipy")


def parquet_fault() -> str:
    """Why ``--parquet`` cannot be written here, and the remedy; empty if it can."""
    if find_spec("pyarrow") is not None:
        return ""
    return not_installed("--parquet", "parquet", "pyarrow")
