"""What a campaign's runs come to: a row for each combination, and paired differences with intervals.

A pair is two runs that differ in one axis only: same world, same seed. Times are compared where both reached every
target; intervals are those of 95 %, by resampling pairs.

Nouns: paired difference.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import AXES, RunResult, RunSpec
from sitl.experiments.results_page import share_with_interval

Runs = Sequence[tuple[RunSpec, RunResult]]
DRAWS = 2000
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
    table = [[*map(shown, key), *_row(results)] for key, results in groups.items()]
    if len(groups) > 1:
        table.append(["all", *[""] * (len(axes) - 1), *_row([result for _, result in runs])])
    return table


def broken_counts(runs: Runs) -> list[tuple[Policy, int]]:
    """Each policy that was broken, and in how many runs."""
    counts = Counter(policy for _, result in runs for policy in broken(result))
    return [(policy, counts[policy]) for policy in Policy if counts[policy]]


def shown(value: object) -> str:
    """A value of an axis as text; of a file its name alone."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else Path(str(value)).stem


def differences(campaign: CampaignTable, runs: Runs) -> Iterator[PairedDifference]:
    """For each axis that varies and each world: every value against the axis's first one."""
    for axis in (axis for axis in varied(campaign) if axis != "world"):
        for world in campaign.worlds:
            own = [(spec, result) for spec, result in runs if spec.world == world]
            by_value = dict[object, dict[tuple[object, ...], RunResult]]()
            for spec, result in own:
                by_value.setdefault(getattr(spec, axis), {})[spec.without(axis)] = result
            first = values_of(campaign, axis)[0]
            for value, results in by_value.items():
                if value != first and first in by_value:
                    cells = _paired(results, by_value[first])
                    yield PairedDifference(axis, shown(world), shown(value), shown(first), cells)


def _row(results: Sequence[RunResult]) -> list[str]:
    complete = [one for one in results if one.complete]
    times_s = np.array([one.seconds for one in complete])
    counts = [sum(getattr(one, name) for one in results) for name in ("touched", "run_into", "refused")]
    missed = sum(one.targets - one.reached for one in results)
    errors = sum(one.outcome == "error" for one in results)
    driven = [[one.metres for one in complete], [1e3 * one.drawn_ah for one in complete]]
    means = [f"{np.mean(values):.1f}" if complete else "-" for values in driven]
    low_high = "-" if len(complete) < 2 else "{:.1f} to {:.1f}".format(*interval(times_s))
    mean_s = f"{times_s.mean():.1f}" if complete else "-"
    closest = f"{min((one.clearance_m for one in results), default=0.0):.2f}"
    searches = sum(one.searches for one in results)
    by_ga = f"{sum(one.genetic_searches for one in results) / searches:.2f}" if searches else "-"
    bounded = [one for one in complete if one.bound_s > 0.0]
    least_s = sum(one.bound_s for one in bounded)
    over = f"{sum(one.seconds for one in bounded) / least_s:.2f}" if bounded else "-"
    return [
        f"{len(results)}", share_with_interval(len(complete), len(results)), *map(str, (*counts, missed, errors)),
        mean_s, low_high, over, closest, *means, by_ga,
    ]  # fmt: skip


def interval(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> tuple[float, float]:
    """The 95 % interval of a mean, by resampling."""
    picks = np.random.default_rng(0).integers(len(values), size=(DRAWS, len(values)))
    low, high = np.percentile(values[picks].mean(axis=1), (2.5, 97.5))
    return float(low), float(high)


def _paired(these: dict[tuple[object, ...], RunResult], others: dict[tuple[object, ...], RunResult]) -> tuple[str, ...]:
    pairs = [(these[key], others[key]) for key in these if key in others]
    both = np.array([(a.seconds, b.seconds) for a, b in pairs if a.complete and b.complete]).reshape(-1, 2)
    counts = (
        f"{len(both)}", f"{sum(a.complete > b.complete for a, b in pairs)}",
        f"{sum(b.complete > a.complete for a, b in pairs)}",
    )  # fmt: skip
    if len(both) < 2:
        return (f"{len(pairs)}", "-", "-", "-", "-", *counts)
    low_s, high_s = interval(both[:, 0] - both[:, 1])
    picks = np.random.default_rng(0).integers(len(both), size=(DRAWS, len(both)))
    means = both[picks].mean(axis=1)
    low, high = np.percentile(means[:, 0] / means[:, 1], (2.5, 97.5))
    mean, other = both.mean(axis=0)
    return (
        f"{len(pairs)}", f"{mean:.1f}", f"{other:.1f}", f"{mean - other:+.1f} ({low_s:+.1f} to {high_s:+.1f})",
        f"{mean / other:.3f} ({low:.3f} to {high:.3f})", *counts,
    )  # fmt: skip
