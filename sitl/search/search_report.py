"""The report of a search: an HTML page with its starts, the way to what was found, and each find's command; and a CSV.

Nouns: kept find.
"""

from __future__ import annotations

import html
import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from companion.storage.files import whole_file
from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.page_parts import REPLAYS, document, long_columns, number_of, picture, table
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.summary import labels, varied
from sitl.campaign.tables import records_of, write_records
from sitl.search.best_values import best_values
from sitl.search.found_file import differences
from sitl.search.goals import FOUND, MEASURES, Goal
from sitl.search.search import IMPOSSIBLE, Find, Generation

MOST_STARTS = 500
"""More rows are not listed."""
MOST_FINDS = 1000
FIND_HEAD = ("rule", "world", "seed", "outcome", "touched", "refused", "closest m", "differs", "drive it again")


@dataclass(frozen=True, slots=True)
class KeptFind:
    """A find that was made small. ``spec``: the run as it counts from the folder of ``file``, the campaign of it."""

    find: Find
    spec: RunSpec
    file: Path

    @property
    def replay(self) -> tuple[str, ...]:
        """What drives it again: of ``rover-sitl``, without the place of the record."""
        return "campaign", str(self.file), "--replay", self.spec.id

    @property
    def command(self) -> str:
        """What drives it again, with a record."""
        return f"rover-sitl {shlex.join(self.replay)} --record out/{self.spec.id}"


@dataclass(frozen=True, slots=True)
class SearchResult:
    """All that a search has done so far.

    ``left_out``: kinds of finds that were too many to be made small; ``tries``: the runs that made finds small;
    ``ended``: it was not stopped. ``found``: all finds, also of the tries. ``command``: of the search,
    as ``rover-sitl`` is told it.
    """

    goal: Goal
    budget: int
    generations: Sequence[Generation]
    kept: Sequence[KeptFind]
    left_out: int
    tries: int
    ended: bool
    found: Sequence[Find]
    command: tuple[str, ...]

    @property
    def evaluations(self) -> int:
        """Runs of the search."""
        return sum(len(one.evaluations) for one in self.generations)

    @property
    def wrong(self) -> dict[str, list[Find]]:
        """All finds by their run's ID: first those of the search, also of a generation that was not gone through."""
        runs = dict[str, list[Find]]()
        for find in [*(find for generation in self.generations for find in generation.finds), *self.found]:
            own = runs.setdefault(find.spec.id, [])
            if find.rule not in [one.rule for one in own]:
                own.append(find)
        return runs


def write_search_report(file: Path, campaign: CampaignTable, result: SearchResult) -> None:
    """Raises OSError."""
    with whole_file(file) as new:
        new.write_text(page(campaign, result), encoding="utf-8")


def write_evaluations(file: Path, result: SearchResult) -> None:
    """CSV, a line for each run of the search, in its order; ``distance`` is empty where it could not be driven.

    Raises OSError.
    """
    records = list[dict[str, object]]()
    for generation in result.generations:
        rows = records_of([(one.spec, one.result) for one in generation.evaluations])
        for one, row in zip(generation.evaluations, rows, strict=True):
            distance = "" if one.distance == IMPOSSIBLE else one.distance
            shows = " ".join(find.rule for find in one.finds)
            here = {"start": generation.start, "generation": generation.number, "distance": distance, "shows": shows}
            records.append({"evaluation": len(records) + 1, **here, **row})
    write_records(file, records)


def page(campaign: CampaignTable, result: SearchResult) -> str:
    """The whole page; it loads nothing."""
    starts = result.generations[-1].start
    still = "" if result.ended else " <b>The search was stopped; the same command goes on.</b>"
    parts = [
        f"<h1>{html.escape(campaign.name)}: search for {result.goal}</h1>",
        f"<p>{result.evaluations} of {number_of(result.budget, 'run')} in "
        f"{number_of(len(result.generations), 'generation')} of {number_of(starts, 'start')}, "
        f"and {number_of(result.tries, 'run')} that made finds small.{still}</p>",
        "<h2>What was found</h2>",
        *_finds(result),
        "<h2>How near it came</h2>",
        picture(
            best_values(result.goal, result.generations),
            f"Each run: {MEASURES[result.goal]}. Crosses at the lower edge: runs that show what is looked for.",
        ),
        *_starts(campaign, result),
        *_every_find(result),
    ]
    return document(f"{campaign.name}: search for {result.goal}", parts)


def _finds(result: SearchResult) -> list[str]:
    counts = Counter(find.rule.value for one in result.generations for find in one.finds)
    if not counts:
        return ["<p>No run went wrong.</p>"]
    told = ", ".join(f"{rule} in {count}" for rule, count in counts.items())
    lines = [
        (
            kept.find.rule.value, kept.find.spec.world, f"{kept.spec.seed}", kept.find.result.outcome,
            f"{kept.find.result.touched}", f"{kept.find.result.refused}", f"{kept.find.result.clearance_m:.2f}",
            differences(kept.find), kept.command,
        )
        for kept in result.kept
    ]  # fmt: skip
    wide = {*long_columns(lines, [1]), 7}
    whole = (
        table(
            FIND_HEAD, lines, text={0, 1, 3}, wide=wide, code={8}, runs=[one.spec.id for one in result.kept], linked=2
        )
        if lines
        else "<p>None is made small yet.</p>"
    )
    more = f" {result.left_out} more kinds were left out." if result.left_out else ""
    return [
        f"<p>{REPLAYS}Runs of the search that went wrong: {html.escape(told)}. The first of each rule and combination "
        "is made as small as it can be: <i>differs</i> is all that it needs beside the usual. Its file, a campaign of "
        "one run, stands in the command that drives it again with a record; <code>rover-companion report FOLDER</code> "
        f"shows the record.{more}</p>",
        whole,
    ]


def _every_find(result: SearchResult) -> list[str]:
    """As they were found; one that is like an earlier one is not made small, but can be driven again."""
    wrong = result.wrong
    if not wrong:
        return []
    lines = [
        (
            " ".join(find.rule for find in finds), finds[0].base.world, f"{finds[0].base.seed}",
            finds[0].result.outcome, f"{finds[0].result.touched}", f"{finds[0].result.refused}",
            f"{finds[0].result.clearance_m:.2f}", differences(finds[0]),
            f"rover-sitl {shlex.join(result.command)} --replay {run_id} --record out/{run_id}",
        )
        for run_id, finds in list(wrong.items())[:MOST_FINDS]
    ]  # fmt: skip
    shown = table(
        FIND_HEAD, lines, text={0, 1, 3}, wide={*long_columns(lines, [1]), 7}, code={8}, runs=list(wrong), linked=2
    )
    first = f"The first {MOST_FINDS} of {len(wrong)} runs; evaluations.csv has the <i>id</i> of each. "
    return [
        f"<h2>Every find</h2><p>{REPLAYS}{first if len(wrong) > MOST_FINDS else ''}As they were found, before any was "
        "made small, and what was found while others were made small. The commands are to be given in the folder from "
        "which the search was driven.</p>",
        f'<div class="long">{shown}</div>',
    ]


def _starts(campaign: CampaignTable, result: SearchResult) -> list[str]:
    axes = varied(campaign)
    words = {axis: labels(campaign, axis) for axis in axes}
    lines = []
    for start, group in groupby(result.generations, key=lambda one: one.start):
        generations = list(group)
        base = generations[0].base
        runs = [one for generation in generations for one in generation.evaluations]
        near = [one.distance for one in runs if one.distance not in (FOUND, IMPOSSIBLE)]
        shows = dict.fromkeys(find.rule.value for one in runs for find in one.finds)
        lines.append(
            (
                *(words[axis][getattr(base, axis)] for axis in axes), f"{start}", f"{base.seed}", f"{len(generations)}",
                f"{len(runs)}", f"{min(near):.3f}" if near else "-", " ".join(shows) or "-",
            )
        )  # fmt: skip
    long = long_columns(lines, range(len(axes)))
    more = f"The first {MOST_STARTS} of {len(lines)} starts. " if len(lines) > MOST_STARTS else ""
    head = (*axes, "start", "seed", "generations", "runs", "nearest", "found")
    return [
        f"<h2>Starts</h2><p>{more}Each begins with the next combination and seed, and ends when it has found what is "
        f"looked for, or after some generations. <i>nearest</i>: {MEASURES[result.goal]}, of its runs that do not show "
        "it.</p>",
        table(head, lines[:MOST_STARTS], text={*range(len(axes)), len(head) - 1}, wide=long),
    ]
