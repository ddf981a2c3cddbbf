"""What ``rover-sitl campaign`` puts out: tables on the terminal, the report, and tables for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import typer
from rich.console import Console

from companion.cli.inputs import written
from sitl.campaign.campaign_file import CampaignTable, run_count
from sitl.campaign.page_parts import number_of
from sitl.campaign.report import write_report
from sitl.campaign.summary import HEAD, PAIR_HEAD, Runs, broken_counts, differences, rows, short_labels, varied
from sitl.campaign.tables import write_csv, write_parquet
from sitl.experiments.results_page import terminal_table, without_intervals

REPORT, CSV, PARQUET = "report.html", "runs.csv", "runs.parquet"
NARROW = ("runs", "complete", "touched", "missed", "errors", "mean s")
"""The columns for a terminal."""
MOST_AXES = 2
"""More columns of names would be cut off on a terminal of 80 columns: then they share one."""
PAIRS = ("axis", "world", "values", "pairs", "ratio of times")


def put_out(
    console: Console, table: CampaignTable, runs: Runs, source: Path, folder: Path, *, parquet: bool = False
) -> None:
    """All of it. ``source``: the campaign's file; ``folder``: of the results. Raises OutputError."""
    short = {axis: short_labels(table, axis) for axis in varied(table)}
    names, lines = _of_combinations(table, runs, short)
    title = f"{table.name}: {len(runs)} of {run_count(table)} runs"
    console.print(terminal_table(title, (*names, *NARROW), lines, names))
    pairs = [
        [
            one.axis, short["world"][one.world], f"{short[one.axis][one.value]} / {short[one.axis][one.other]}",
            one.cells[0], one.cells[PAIR_HEAD.index("ratio")],
        ]
        for one in differences(table, runs)
    ]  # fmt: skip
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


def _of_combinations(
    table: CampaignTable, runs: Runs, short: Mapping[str, Mapping[str, str]]
) -> tuple[list[str], list[list[str]]]:
    """The columns of names, and a line for each combination."""
    axes, named, figures = list(short), list[list[str]](), list[list[str]]()
    for line in without_intervals(rows(table, runs)):
        texts = zip(axes, line, strict=False)
        named.append([short[axis].get(text, text) for axis, text in texts])
        figures.append([line[len(axes) + HEAD.index(name)] for name in NARROW])
    if len(axes) > MOST_AXES:
        named = [[", ".join(_said(axis, text) for axis, text in zip(axes, one, strict=True) if text)] for one in named]
        axes = [", ".join(axes)]
    return axes, [[*one, *others] for one, others in zip(named, figures, strict=True)]


def _said(axis: str, text: str) -> str:
    """A value that says what it is a value of: ``yes`` alone does not."""
    return f"{axis} {text}" if axis in ("guard", "off_model", "late_s") else text
