"""Runs as tables for other programs: CSV and Parquet, a row a run."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from companion.storage.files import whole_file
from sitl.campaign.policies import broken
from sitl.campaign.summary import Runs
from sitl.generators.measures import Difficulty

LEFT_OUT = ("dwelt", "ground")


def write_csv(file: Path, runs: Runs) -> None:
    """A line a run. Raises OSError."""
    write_records(file, records_of(runs))


def write_records(file: Path, records: Sequence[Mapping[str, object]]) -> None:
    """A line a record, as CSV; all have the same keys. Raises OSError."""
    with whole_file(file) as new, new.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, records[0].keys() if records else ["id"])
        writer.writeheader()
        writer.writerows(records)


def write_parquet(file: Path, runs: Runs) -> None:
    """The same for pandas, polars, DuckDB; needs pyarrow. Raises OSError."""
    import pyarrow
    from pyarrow import parquet

    with whole_file(file) as new:
        parquet.write_table(pyarrow.Table.from_pylist(records_of(runs)), new)


def records_of(runs: Runs) -> list[dict[str, object]]:
    """A flat record a run: what it was, and what came out."""
    return [
        {
            "id": spec.id,
            **asdict(spec),
            **{name: value for name, value in asdict(result).items() if name not in LEFT_OUT},
            "complete": result.complete,
            "broken": " ".join(broken(result)),
            **{one.name: getattr(result.ground, one.name, None) for one in fields(Difficulty)},
        }
        for spec, result in runs
    ]
