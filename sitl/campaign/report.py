"""The report of a campaign: one HTML file with tables, distributions, paired differences and where time was lost."""

from __future__ import annotations

import html
from pathlib import Path

from companion.storage.files import whole_file
from sitl.campaign.campaign_file import CampaignTable, run_count
from sitl.campaign.heat_maps import MOST_PANELS, heat_maps
from sitl.campaign.page_parts import document, long_columns, number_of, picture, table
from sitl.campaign.pictures import times
from sitl.campaign.policies import Policy
from sitl.campaign.runs_table import runs_table
from sitl.campaign.summary import HEAD, PAIR_HEAD, Runs, broken_counts, differences, rows, varied


def write_report(file: Path, campaign: CampaignTable, runs: Runs, source: Path) -> None:
    """Write it. ``source``: the campaign's file, for the commands that drive a run again. Raises OSError."""
    with whole_file(file) as new:
        new.write_text(page(campaign, runs, source), encoding="utf-8")


def page(campaign: CampaignTable, runs: Runs, source: Path) -> str:
    """The whole page; it loads nothing."""
    axes = varied(campaign)
    pairs = [(one.axis, one.world, one.value, one.other, *one.cells) for one in differences(campaign, runs)]
    lines, count = rows(campaign, runs), run_count(campaign)
    still = f" <b>Not all runs are done: {count - len(runs)} are left.</b>" if len(runs) < count else ""
    parts = [
        f"<h1>{html.escape(campaign.name)}</h1>",
        f"<p>{len(runs)} of {count} runs, seeds {campaign.seed} to {campaign.seed + campaign.runs - 1}.{still} "
        "Companion and simulator in lock-step. <i>complete</i>: every target reached and nothing touched, with its "
        "exact 95 % interval; <i>touched</i>: contacts while the rover moved; <i>run into</i>: it stood, and something "
        "that moves came along; <i>refused</i>: setpoints that the last look replaced by a stop; <i>mean s</i>, "
        "<i>metres</i>, <i>mAh</i>: driving time with its 95 % interval, distance and charge of complete runs; "
        "<i>/bound</i>: their time over that of the shortest way at any angle on known ground at cruise speed; "
        "<i>by GA</i>: the share of searches that the genetic "
        "algorithm answered, and not the graph search behind it.</p>",
        table((*axes, *HEAD), lines, range(len(axes)), wide=long_columns(lines, range(len(axes)))),
    ]
    parts.append(_policies(runs))
    if pairs:
        parts += [
            "<h2>Pairs</h2><p>Two runs that differ in one axis only: same world, same seed. Each value against the "
            "axis's first one; times where both are complete. <i>ratio</i>: the geometric mean of the pairs' ratios. "
            "95 % intervals by Student's t over seeds.</p>",
            table(
                ("axis", "world", "value", "against", *PAIR_HEAD), pairs, range(4), wide=long_columns(pairs, range(4))
            ),
        ]
    if any(result.complete for _, result in runs):
        parts += [
            "<h2>Driving times</h2>",
            picture(times(campaign, runs), "Share of all runs that were complete within so long"),
        ]
    maps = heat_maps(campaign, runs, source.resolve().parent)
    if maps:
        parts.append(
            "<h2>Where the time goes</h2><p>Seconds in each square of one metre where a run stayed "
            f"for a second or more, of each combination (the first {MOST_PANELS}), in the same colours. A mission's "
            "ground is the same in all its runs: the mean over them. Generated ground is another one for each seed: of "
            "each kind the ground in the middle and the one with most time lost, which is driving time beyond the "
            "bound, the mean over the combinations.</p>"
        )
        parts += [picture(figure, what) for what, figure in maps]
    parts.append(runs_table(campaign, runs, source))
    return document(campaign.name, parts)


def _policies(runs: Runs) -> str:
    """Which were broken, in how many runs."""
    counts = broken_counts(runs)
    told = ", ".join(f"{policy} in {number_of(count, 'run')}" for policy, count in counts) or "none"
    return f"<p><b>Policies broken: {html.escape(told)}.</b> They are checked in every run: {', '.join(Policy)}.</p>"
