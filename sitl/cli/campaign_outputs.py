"""What ``rover-sitl campaign`` puts out: tables on the terminal, the report, and tables for other programs."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console

from companion.cli.inputs import written
from sitl.campaign.campaign_file import CampaignTable, run_count
from sitl.campaign.report import write_report
from sitl.campaign.summary import HEAD, PAIR_HEAD, Runs, broken_counts, differences, rows, varied
from sitl.campaign.tables import write_csv, write_parquet
from sitl.cli.runs import number_of
from sitl.experiments.results_page import terminal_table, without_intervals

REPORT, CSV, PARQUET = "report.html", "runs.csv", "runs.parquet"
NARROW = ("runs", "complete", "touched", "missed", "errors", "mean s")
"""The columns for a terminal."""
PAIRS = ("axis", "world", "values", "pairs", "ratio of times")


def put_out(
    console: Console, table: CampaignTable, runs: Runs, source: Path, folder: Path, *, parquet: bool = False
) -> None:
    """All of it. ``source``: the campaign's file; ``folder``: of the results. Raises OutputError."""
    axes = varied(table)
    lines = [
        [*line[: len(axes)], *(line[len(axes) + HEAD.index(name)] for name in NARROW)]
        for line in without_intervals(rows(table, runs))
    ]
    console.print(
        terminal_table(f"{table.name}: {len(runs)} of {run_count(table)} runs", (*axes, *NARROW), lines, axes)
    )
    pairs = [
        [one.axis, one.world, f"{one.value} / {one.other}", one.cells[0], one.cells[PAIR_HEAD.index("ratio")]]
        for one in differences(table, runs)
    ]
    if pairs:
        console.print(terminal_table("pairs", PAIRS, pairs, PAIRS[:3]))
    told = ", ".join(f"{policy} in {number_of(count, 'run')}" for policy, count in broken_counts(runs)) or "none"
    typer.echo(f"policies broken: {told}")
    with written(folder / REPORT):
        write_report(folder / REPORT, table, runs, source)
    with written(folder / CSV):
        write_csv(folder / CSV, runs)
    if parquet:
        with written(folder / PARQUET):
            write_parquet(folder / PARQUET, runs)
    typer.echo(f"report: {folder / REPORT}")
