"""The report of a campaign: one HTML file with tables, distributions, paired differences and where time was lost."""

from __future__ import annotations

import base64
import html
import io
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from companion.storage.files import whole_file
from sitl.campaign.campaign_file import CampaignTable, run_count
from sitl.campaign.pictures import MOST_PANELS, heat_maps, times
from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.summary import HEAD, PAIR_HEAD, Runs, broken_counts, differences, rows, shown, varied

MOST_LISTED = 200
SLOWEST = 10
STYLE = """
:root { color-scheme: light dark; --line: #8886; --soft: #8882; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
/* A shadow at an edge behind which the table goes on: what covers it scrolls along with the table. */
.scroll { overflow-x: auto; background:
  linear-gradient(to right, Canvas 50%, transparent) 0 / 3rem 100% no-repeat local,
  linear-gradient(to left, Canvas 50%, transparent) 100% / 3rem 100% no-repeat local,
  linear-gradient(to right, #888a, transparent) 0 / 1rem 100% no-repeat scroll,
  linear-gradient(to left, #888a, transparent) 100% / 1rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { background: var(--soft); vertical-align: bottom; } th.text, td.text { text-align: left; }
td.wide { white-space: normal; min-width: 18rem; text-align: left; }
figure { margin: 1rem 0; background: #fff; padding: .5rem; display: inline-block; max-width: 100%; }
img { max-width: 100%; height: auto; }
code { font-size: .85em; background: var(--soft); padding: .1rem .3rem; user-select: all; }
"""


def write_report(file: Path, campaign: CampaignTable, runs: Runs, source: Path) -> None:
    """Write it. ``source``: the campaign's file, for the commands that drive a run again. Raises OSError."""
    with whole_file(file) as new:
        new.write_text(page(campaign, runs, source), encoding="utf-8")


def page(campaign: CampaignTable, runs: Runs, source: Path) -> str:
    """The whole page; it loads nothing."""
    axes = varied(campaign)
    pairs = [(one.axis, one.world, one.value, one.other, *one.cells) for one in differences(campaign, runs)]
    parts = [
        f"<h1>{html.escape(campaign.name)}</h1>",
        f"<p>{len(runs)} of {run_count(campaign)} runs, seeds {campaign.seed} to {campaign.seed + campaign.runs - 1}. "
        "Companion and simulator in lock-step. <i>complete</i>: every target reached and nothing touched, with its "
        "exact 95 % interval; <i>touched</i>: contacts while the rover moved; <i>run into</i>: it stood, and something "
        "that moves came along; <i>refused</i>: setpoints that the last look replaced by a stop; <i>mean s</i>, "
        "<i>metres</i>, <i>mAh</i>: driving time with its 95 % interval, distance and charge of complete runs; "
        "<i>/bound</i>: their time over that of the shortest way at any angle on known ground at cruise speed; "
        "<i>by GA</i>: the share of searches that the genetic "
        "algorithm answered, and not the graph search behind it.</p>",
        _table((*axes, *HEAD), rows(campaign, runs), len(axes)),
    ]
    parts.append(_policies(runs))
    if pairs:
        parts += [
            "<h2>Pairs</h2><p>Two runs that differ in one axis only: same world, same seed. Each value against the "
            "axis's first one; times where both are complete. <i>ratio</i>: the geometric mean of the pairs' ratios. "
            "95 % intervals by Student's t over seeds.</p>",
            _table(("axis", "world", "value", "against", *PAIR_HEAD), pairs, 4),
        ]
    if any(result.complete for _, result in runs):
        parts += ["<h2>Driving times</h2>", _figure(times(campaign, runs), "driving times of complete runs")]
    maps = heat_maps(campaign, runs, source.resolve().parent)
    if maps:
        parts.append(
            "<h2>Where the time goes</h2><p>Seconds in each square of one metre where a run stayed "
            "for a second or more: mean over the runs of each combination "
            f"(the first {MOST_PANELS}), in the same colours.</p>"
        )
        parts += [_figure(figure, f"where the time goes: {world}") for world, figure in maps]
    parts += _lists(campaign, runs, source)
    return _document(campaign.name, parts)


def _policies(runs: Runs) -> str:
    """Which were broken, in how many runs."""
    counts = broken_counts(runs)
    told = ", ".join(f"{policy} in {count} runs" for policy, count in counts) or "none"
    return f"<p><b>Policies broken: {html.escape(told)}.</b> They are checked in every run: {', '.join(Policy)}.</p>"


def _lists(campaign: CampaignTable, runs: Runs, source: Path) -> list[str]:
    bad = [one for one in runs if not one[1].complete or broken(one[1])]
    slow = sorted((one for one in runs if one[1].complete), key=lambda one: -one[1].seconds)[:SLOWEST]
    again = f"rover-sitl campaign {shlex.quote(str(source))} --replay ID --record FOLDER"
    parts = [
        "<h2>Worth a look</h2>",
        f"<p>To drive one run again, with a record: <code>{html.escape(again)}</code></p>",
    ]
    more = f"; the first {MOST_LISTED} of them" if len(bad) > MOST_LISTED else ""
    count = "1 run was" if len(bad) == 1 else f"{len(bad)} runs were"
    parts += [f"<p>{count} not complete, or broke a policy{more}.</p>"] if bad else []
    parts += [_runs(campaign, bad[:MOST_LISTED])] if bad else ["<p>Every run was complete.</p>"]
    return [*parts, "<h2>The slowest</h2>", _runs(campaign, slow)] if slow else parts


def _runs(campaign: CampaignTable, runs: Sequence[tuple[RunSpec, RunResult]]) -> str:
    axes = varied(campaign)
    lines = [
        (
            *(shown(getattr(spec, axis)) for axis in axes), f"{spec.seed}", " ".join(broken(result)), result.outcome,
            f"{result.reached} of {result.targets}", f"{result.touched}", f"{result.refused}", f"{result.seconds:.1f}",
            result.said, spec.id,
        )
        for spec, result in runs
    ]  # fmt: skip
    head = (*axes, "seed", "broke", "outcome", "targets", "touched", "refused", "s", "last word", "ID")
    return _table(head, lines, len(axes), wide=(len(head) - 2,), code=(len(head) - 1,))


def _table(
    head: Sequence[str],
    lines: Iterable[Sequence[str]],
    texts: int,
    wide: Sequence[int] = (),
    code: Sequence[int] = (),
) -> str:
    """``texts``: so many columns from the left are words."""

    def cell(number: int, text: str) -> str:
        inside = html.escape(text)
        kind = "wide" if number in wide else "text" if number < texts or number in code else ""
        return f'<td class="{kind}">{f"<code>{inside}</code>" if number in code else inside}</td>'

    top = "".join(f'<th class="{"text" if n < texts else ""}">{html.escape(name)}</th>' for n, name in enumerate(head))
    body = "".join(f"<tr>{''.join(cell(n, text) for n, text in enumerate(line))}</tr>" for line in lines)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _figure(figure: Figure, what: str) -> str:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110, metadata={"Software": None})
    data = base64.b64encode(out.getvalue()).decode()
    return f'<figure><img alt="{html.escape(what)}" src="data:image/png;base64,{data}"></figure>'


def _document(title: str, parts: Iterable[str]) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )
