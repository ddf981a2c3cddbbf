"""What a campaign's runs come to: a row for each combination, and paired differences with intervals.

A pair is two runs that differ in one axis only: same world, same seed. Times are compared where both reached every
target. Intervals are those of 95 % by Student's t, over seeds: pairs of one seed lie on the same ground, so they count
as one.

Nouns: paired difference.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.policies import ERROR, Policy, broken
from sitl.campaign.run_spec import AXES, RunResult, RunSpec
from sitl.campaign.worded import BETWEEN_FAULTS
from sitl.experiments.results_page import share_with_interval, without_intervals

Runs = Sequence[tuple[RunSpec, RunResult]]
WORDED = ("world", "sensors", "faults")
"""Axes whose values may be a name and what differs."""
FEWEST = 3
"""With fewer seeds no interval is told."""
FILES = (".toml", ".plan", ".waypoints")
HEAD = (
    "runs", "complete", "touched", "run into", "refused", "missed", "errors", "mean s", "95 %", "/bound",
    "closest m", "metres", "mAh", "by GA",
)  # fmt: skip
PAIR_HEAD = ("pairs", "mean s", "against s", "difference s", "ratio", "both complete", "only this", "only other")


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """One value of an axis against the axis's first one, over all pairs of a world."""

    axis: str
    world: str
    value: str
    other: str
    cells: tuple[str, ...]
    """As ``PAIR_HEAD``."""


def varied(campaign: CampaignTable) -> list[str]:
    """The axes with more than one value; the world always."""
    return [axis for axis in AXES if axis == "world" or len(values_of(campaign, axis)) > 1]


def values_of(campaign: CampaignTable, axis: str) -> list[object]:
    """The values of an axis; the first one is what the others are compared with."""
    values: dict[str, Sequence[object]] = {
        "world": campaign.worlds,
        "planner": campaign.planners,
        "controller": campaign.controllers,
        "sensors": campaign.sensors,
        "faults": campaign.faults,
        "guard": campaign.guard,
        "off_model": campaign.off_model,
        "late_s": campaign.late_s,
        "settings": list(campaign.settings),
    }
    return list(values[axis])


def rows(campaign: CampaignTable, runs: Runs) -> list[list[str]]:
    """A row for each combination of the axes that vary, in the order of the file, and one for all."""
    axes, groups = varied(campaign), dict[tuple[object, ...], list[RunResult]]()
    for spec, result in runs:
        groups.setdefault(tuple(getattr(spec, axis) for axis in axes), []).append(result)
    words = [labels(campaign, axis) for axis in axes]
    table = [
        [*(word[value] for word, value in zip(words, key, strict=True)), *_row(results)]
        for key, results in groups.items()
    ]
    if len(groups) > 1:
        table.append(["all", *[""] * (len(axes) - 1), *_row_of_all([result for _, result in runs])])
    return table


def labels(campaign: CampaignTable, axis: str) -> dict[object, str]:
    """The values of an axis as texts, each another one; of a file its name alone, if that says which."""
    values = values_of(campaign, axis)
    short = {value: shown(value) for value in values}
    twice = {text for text, count in Counter(short.values()).items() if count > 1}
    return {value: str(value) if text in twice else text for value, text in short.items()}


def short_labels(campaign: CampaignTable, axis: str) -> dict[str, str]:
    """For a terminal: of ``labels`` without what follows each name, where that still says which."""
    whole = list(labels(campaign, axis).values())
    names = {
        text: "; ".join(piece.split()[0] for piece in text.split(BETWEEN_FAULTS) if piece.strip()) for text in whole
    }
    counts = Counter(names.values())
    return {text: name if counts[name] == 1 and axis in WORDED else text for text, name in names.items()}


def shown(value: object) -> str:
    """A value of an axis as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    return Path(str(value)).stem if str(value).endswith(FILES) else str(value)


def broken_counts(runs: Runs) -> list[tuple[Policy, int]]:
    """Each policy that was broken, and in how many runs."""
    counts = Counter(policy for _, result in runs for policy in broken(result))
    return [(policy, counts[policy]) for policy in Policy if counts[policy]]


Partners = dict[tuple[object, ...], tuple[int, RunResult]]
"""By what pairs have in common: the seed and the result."""


def differences(campaign: CampaignTable, runs: Runs) -> Iterator[PairedDifference]:
    """For each axis that varies and each world: every value against the axis's first one."""
    worlds = labels(campaign, "world")
    for axis in (axis for axis in varied(campaign) if axis != "world"):
        words, first = labels(campaign, axis), values_of(campaign, axis)[0]
        for world in campaign.worlds:
            by_value = dict[object, Partners]()
            for spec, result in runs:
                if spec.world == world:
                    by_value.setdefault(getattr(spec, axis), {})[spec.without(axis)] = spec.seed, result
            for value, results in by_value.items():
                if value != first and first in by_value:
                    cells = _paired(results, by_value[first])
                    yield PairedDifference(axis, worlds[world], words[value], words[first], cells)


def _row(results: Sequence[RunResult]) -> list[str]:
    complete = [one for one in results if one.complete]
    times_s = np.array([one.seconds for one in complete])
    counts = [sum(getattr(one, name) for one in results) for name in ("touched", "run_into", "refused")]
    missed = sum(one.targets - one.reached for one in results)
    errors = sum(one.outcome == ERROR for one in results)
    driven = [[one.metres for one in complete], [1e3 * one.drawn_ah for one in complete]]
    means = [f"{np.mean(values):.1f}" if complete else "-" for values in driven]
    mean_s = f"{times_s.mean():.1f}" if complete else "-"
    low_high = "{:.1f} to {:.1f}".format(*interval(times_s)) if len(complete) >= FEWEST else "-"
    moved = [one.clearance_m for one in results if one.outcome != ERROR]
    closest = f"{min(moved):.2f}" if moved else "-"
    return [
        f"{len(results)}", share_with_interval(len(complete), len(results)), *map(str, (*counts, missed, errors)),
        mean_s, low_high, _over_bound(complete), closest, *means, _by_ga(results),
    ]  # fmt: skip


def _row_of_all(results: Sequence[RunResult]) -> list[str]:
    """Without intervals: runs of one seed lie on the same ground, so they would be too narrow."""
    (row,) = without_intervals([_row(results)])
    row[HEAD.index("95 %")] = "-"
    return row


def _over_bound(complete: Sequence[RunResult]) -> str:
    bounded = [one for one in complete if one.bound_s > 0.0]
    return f"{sum(one.seconds for one in bounded) / sum(one.bound_s for one in bounded):.2f}" if bounded else "-"


def _by_ga(results: Sequence[RunResult]) -> str:
    searches = sum(one.searches for one in results)
    return f"{sum(one.genetic_searches for one in results) / searches:.2f}" if searches else "-"


def interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """The 95 % interval of a mean, by Student's t; needs two values or more."""
    from scipy.stats import t

    mean, reach = float(values.mean()), float(values.std(ddof=1)) / math.sqrt(len(values))
    wide = float(t.ppf(0.975, len(values) - 1)) * reach
    return mean - wide, mean + wide


def _paired(these: Partners, others: Partners) -> tuple[str, ...]:
    pairs = [(these[key][0], these[key][1], others[key][1]) for key in these if key in others]
    both = [(seed, a.seconds, b.seconds) for seed, a, b in pairs if a.complete and b.complete]
    counts = (
        f"{len(both)}", f"{sum(a.complete > b.complete for _, a, b in pairs)}",
        f"{sum(b.complete > a.complete for _, a, b in pairs)}",
    )  # fmt: skip
    if not both:
        return (f"{len(pairs)}", "-", "-", "-", "-", *counts)
    mean, other = (_by_seed([(one[0], one[at]) for one in both]).mean() for at in (1, 2))
    difference = _by_seed([(seed, a - b) for seed, a, b in both])
    ratio = _by_seed([(seed, math.log(a / b)) for seed, a, b in both if a > 0.0 and b > 0.0])
    apart, times = f"{difference.mean():+.1f}", f"{math.exp(ratio.mean()):.3f}" if len(ratio) else "-"
    if min(len(difference), len(ratio)) >= FEWEST:
        apart += " ({:+.1f} to {:+.1f})".format(*interval(difference))
        low, high = interval(ratio)
        times += f" ({math.exp(low):.3f} to {math.exp(high):.3f})"
    return (f"{len(pairs)}", f"{mean:.1f}", f"{other:.1f}", apart, times, *counts)


def _by_seed(values: list[tuple[int, float]]) -> NDArray[np.float64]:
    """The mean of each seed's values."""
    own: dict[int, list[float]] = {}
    for seed, value in values:
        own.setdefault(seed, []).append(value)
    return np.array([np.mean(one) for one in own.values()])
