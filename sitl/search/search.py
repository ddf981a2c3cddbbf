"""The search: generation after generation, the covariance matrix adaptation of ``cma`` moves the genes (ask and tell).

It begins again and again: each start takes the campaign's next combination and seed, and ends when it has found what it
looks for, or after ``GENERATIONS``. The same campaign and goal give the same search, whoever drives the runs.

Nouns: find, generation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from companion.core.extras import not_installed
from companion.settings import SettingsError
from sitl.campaign.campaign_file import CampaignError, CampaignTable
from sitl.campaign.drive_run import settings_of
from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import RunResult, RunSpec, specs_of
from sitl.campaign.worded import GroundSpec
from sitl.search.genes import Gene, Values, genes_of, spec_with
from sitl.search.goals import NOT_DRIVEN, TOLD_TWICE, Goal, distance, shows

GENERATIONS = 8
SPREAD = 0.25
"""Standard deviation of the first generation, in shares of the bounds."""
IMPOSSIBLE = 1000.0
"""The distance of values that no run can have."""
STREAM = 83

Driven = Callable[[Sequence[RunSpec]], list[RunResult]]
"""Drives runs; the results come in the same order."""


@dataclass(frozen=True, slots=True)
class Find:
    """A run that has done something wrong. ``rule``: the goal of the search, or a policy that it broke besides."""

    rule: Goal | Policy
    base: RunSpec
    genes: tuple[Gene, ...]
    values: Values
    result: RunResult

    @property
    def spec(self) -> RunSpec:
        """The run."""
        return spec_with(self.base, self.genes, self.values)

    def again(self, result: RunResult) -> bool:
        """Whether another run has done the same."""
        return shows(self.rule, result) if isinstance(self.rule, Goal) else self.rule in broken(result)


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A run of a generation. ``distance``: how far from what is looked for; the less, the nearer."""

    spec: RunSpec
    result: RunResult
    distance: float
    finds: tuple[Find, ...]


@dataclass(frozen=True, slots=True)
class Generation:
    """Runs that were drawn together. ``start`` and ``number`` (within the start) count from 1."""

    start: int
    number: int
    base: RunSpec
    evaluations: tuple[Evaluation, ...]

    @property
    def finds(self) -> list[Find]:
        """Of all its runs."""
        return [find for one in self.evaluations for find in one.finds]

    @property
    def cost(self) -> int:
        """Of the budget: a generation without any run that can be driven must not go on for ever."""
        return max(len(self.evaluations), 1)


def searched(campaign: CampaignTable, goal: Goal, budget: int, drive: Driven) -> Iterator[Generation]:
    """Each generation when it is driven, until ``budget`` runs are driven and no more.

    Raises CampaignError if ``cma`` is not installed.
    """
    left = budget
    for number, base in enumerate(_bases(campaign)):
        for generation in _one_start(campaign, goal, base, number, drive, left):
            left -= generation.cost
            yield generation
        if left <= 0:
            return


def first_bases(campaign: CampaignTable) -> list[RunSpec]:
    """Every combination, with the first seed."""
    return list(specs_of(campaign.model_copy(update={"runs": 1})))


def _bases(campaign: CampaignTable) -> Iterator[RunSpec]:
    """Seed after seed, every combination, for ever."""
    for seed in count(campaign.seed):
        yield from specs_of(campaign.model_copy(update={"seed": seed, "runs": 1}))


def _one_start(
    campaign: CampaignTable, goal: Goal, base: RunSpec, start: int, drive: Driven, left: int
) -> Iterator[Generation]:
    """Its generations; the last one is cut off where no more than ``left`` runs are left."""
    genes = genes_of(campaign, base)
    optimiser = _optimiser(genes, base, start)
    for number in range(1, GENERATIONS + 1):
        asked = optimiser.ask()
        values = [_values(genes, shares) for shares in asked]
        specs = [spec_with(base, genes, one) for one in values]
        possible = [(spec, one) for spec, one in zip(specs, values, strict=True) if _is_possible(spec)][:left]
        driven = [spec for spec, _ in possible]
        results = dict(zip((spec.id for spec in driven), drive(driven), strict=True))
        evaluations = tuple(_evaluated(goal, base, genes, one, results[spec.id]) for spec, one in possible)
        generation = Generation(start + 1, number, base, evaluations)
        left -= generation.cost
        yield generation
        if left <= 0 or any(find.rule == goal for find in generation.finds):
            return
        optimiser.tell(asked, [_distance(goal, results.get(spec.id)) for spec in specs])
        if optimiser.stop():
            return


def _evaluated(goal: Goal, base: RunSpec, genes: tuple[Gene, ...], values: Values, result: RunResult) -> Evaluation:
    finds = tuple(finds_in(goal, base, genes, values, result))
    return Evaluation(spec_with(base, genes, values), result, _distance(goal, result), finds)


def finds_in(goal: Goal, base: RunSpec, genes: tuple[Gene, ...], values: Values, result: RunResult) -> list[Find]:
    """By what a run has done: the goal of the search, and all policies that it breaks."""
    rules: list[Goal | Policy] = [goal] if shows(goal, result) else []
    rules += [policy for policy in broken(result) if policy is not TOLD_TWICE.get(goal)]
    return [Find(rule, base, genes, values, result) for rule in rules]


def _distance(goal: Goal, result: RunResult | None) -> float:
    return IMPOSSIBLE if result is None or result.outcome in NOT_DRIVEN else distance(goal, result)


def _values(genes: tuple[Gene, ...], shares: Sequence[float]) -> Values:
    """Those that are as usual are left out."""
    given = {gene.name: gene.value(float(share)) for gene, share in zip(genes, shares, strict=True)}
    return {gene.name: given[gene.name] for gene in genes if given[gene.name] != gene.usual}


def _is_possible(spec: RunSpec) -> bool:
    """Settings may contradict each other, and parameters of the ground."""
    try:
        settings_of(spec)
        GroundSpec.of(spec.world)
    except (SettingsError, ValueError):
        return False
    return True


def _optimiser(genes: tuple[Gene, ...], base: RunSpec, number: int) -> Any:
    try:
        import cma
    except ImportError as error:
        raise CampaignError(not_installed("--search", "search", "cma")) from error
    rng = np.random.default_rng((base.seed, number, STREAM))
    usual = np.array([gene.share(gene.usual) for gene in genes])
    begin = usual + rng.uniform(0.0, 0.5, len(genes)) * (rng.uniform(0.0, 1.0, len(genes)) - usual)
    options = {"bounds": [0.0, 1.0], "seed": int(rng.integers(1, 2**31)), "verbose": -9, "verb_log": 0}
    return cma.CMAEvolutionStrategy(begin, SPREAD, options)
