"""The report's table of single runs: what went wrong first, and for each run the command that drives it again."""

from __future__ import annotations

import html
import shlex
from pathlib import Path

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.page_parts import REPLAYS, long_columns, table
from sitl.campaign.policies import broken
from sitl.campaign.run_spec import AXES, RunResult, RunSpec
from sitl.campaign.summary import Runs, labels, varied

MOST_ROWS = 2000
"""With more rows browsers become slow."""
SCRIPT = Path(__file__).with_suffix(".js")
COLUMNS = (
    "seed", "broke", "outcome", "targets", "touched", "refused", "s", "/bound", "closest m", "last word",
    "drive it again",
)  # fmt: skip
CHOSEN = ("seed", "broke", "outcome")
"""Beside the axes: of these the page offers the values to choose from."""


def runs_table(campaign: CampaignTable, runs: Runs, source: Path) -> str:
    """A row a run; the page filters and sorts them. ``source``: the campaign's file."""
    axes = varied(campaign)
    words = {axis: labels(campaign, axis) for axis in axes}
    ordered = sorted(runs, key=_rank)[:MOST_ROWS]
    lines = [
        [*(words[axis][getattr(spec, axis)] for axis in axes), *_cells(spec, one, source)] for spec, one in ordered
    ]
    head = (*axes, *COLUMNS)
    long = long_columns(lines, range(len(axes)))
    text = {*range(len(axes)), *(head.index(name) for name in ("broke", "outcome"))}
    columns = [*range(len(axes)), *(head.index(name) for name in CHOSEN)]
    whole = table(
        head,
        lines,
        text,
        wide={*long, head.index("last word")},
        code={len(head) - 1},
        runs=[spec.id for spec, _ in ordered],
        linked=head.index("seed"),
    )
    return (
        f"<h2>Every run</h2><p>{REPLAYS}{_told(campaign, len(runs))}</p>"
        f'<p class="filter" id="filter" data-columns="{" ".join(map(str, columns))}" hidden>'
        '<label>with the words <input type="search"></label><output></output></p>'
        f'<div class="long" id="runs">{whole}</div>'
        f'<script type="module">{SCRIPT.read_text(encoding="utf-8")}</script>'
    )


def _told(campaign: CampaignTable, count: int) -> str:
    """What stands above the table."""
    same = ", ".join(
        f"{axis} {labels(campaign, axis)[value]}"
        for axis in AXES
        if axis not in varied(campaign)
        for value in labels(campaign, axis)
    )
    first = f"The first {MOST_ROWS} of {count} runs; runs.csv has them all. " if count > MOST_ROWS else ""
    return (
        f"{first}First those that broke a policy, then those that were not complete, each with the longest first. "
        "A click on a column's head sorts by it. <i>drive it again</i>: with a record, in the folder from which the "
        "campaign was driven; <code>rover-companion report FOLDER</code> shows the record. "
        + html.escape(f"The same in every run: {same}." if same else "")
    )


def _rank(one: tuple[RunSpec, RunResult]) -> tuple[bool, bool, float]:
    """What went wrong comes first, then what took long."""
    result = one[1]
    return not broken(result), result.complete, -result.seconds


def _cells(spec: RunSpec, result: RunResult, source: Path) -> list[str]:
    """As ``COLUMNS``."""
    bound = f"{result.seconds / result.bound_s:.2f}" if result.complete and result.bound_s > 0.0 else "-"
    return [
        f"{spec.seed}", " ".join(broken(result)), result.outcome, f"{result.reached} of {result.targets}",
        f"{result.touched}", f"{result.refused}", f"{result.seconds:.1f}", bound, f"{result.clearance_m:.2f}",
        result.said, f"rover-sitl campaign {shlex.quote(str(source))} --replay {spec.id} --record out/{spec.id}",
    ]  # fmt: skip
