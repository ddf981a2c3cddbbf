"""The search on made-up landscapes: it finds what is there, the same each time, and leaves what is not needed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from sitl.campaign.campaign_file import CampaignTable, SearchTable, load_campaign
from sitl.campaign.policies import Policy
from sitl.campaign.run_spec import RunResult, RunSpec, specs_of
from sitl.campaign.worded import SensorSpec
from sitl.search.found_file import counted_from, differences, write_find
from sitl.search.genes import genes_of
from sitl.search.goals import Goal, distance, shows
from sitl.search.minimise import minimised
from sitl.search.search import Find, first_bases, searched

CAMPAIGN = CampaignTable(
    worlds=["cylinders", "yard"],
    guard=[True],
    time_limit_s=100.0,
    search=SearchTable(parts=["rover", "sensors", "settings"]),
)


def clearance_of(spec: RunSpec) -> float:
    """Little where a setting is small and a sensor misses much."""
    clearance_m = json.loads(spec.changes).get("guidance", {}).get("clearance_m", 0.15)
    return max(0.0, 0.3 + 2.0 * clearance_m - 1.5 * (SensorSpec.of(spec.sensors).changes.dropout or 0.0))


def made_up(specs: Sequence[RunSpec]) -> list[RunResult]:
    return [
        RunResult("points", "reached", 1, 1, touched=clear_m < 0.05, seconds=50.0, bound_s=30.0, clearance_m=clear_m)
        for clear_m in map(clearance_of, specs)
    ]


def finds_of(budget: int) -> tuple[list[Find], int]:
    finds, driven = [], 0
    for generation in searched(CAMPAIGN, Goal.COLLISION, budget, made_up):
        finds += generation.finds
        driven += len(generation.evaluations)
    return finds, driven


@pytest.fixture(scope="module")
def finds() -> list[Find]:
    return finds_of(400)[0]


def test_it_finds_what_one_of_a_hundred_random_runs_shows(finds: list[Find]) -> None:
    """A start has some 110 runs at most, and ends with the generation that has found something."""
    assert all(find.rule == Goal.COLLISION and clearance_of(find.spec) < 0.05 for find in finds)
    assert len({(find.base.seed, find.base.world) for find in finds}) >= 3, "starts that have found something"


def test_the_same_campaign_gives_the_same_search(finds: list[Find]) -> None:
    again, driven = finds_of(150)
    assert driven == 150 and len(again) > 1
    assert [(find.spec, find.values) for find in again] == [(find.spec, find.values) for find in finds[: len(again)]]


def test_a_find_is_made_as_small_as_it_can_be(finds: list[Find]) -> None:
    find = finds[0]
    least, besides = minimised(find, Goal.COLLISION, made_up)
    assert 1 <= len(least.values) < len(find.values)
    assert set(least.values) <= {"dropout", "guidance.clearance_m"}
    assert clearance_of(least.spec) < 0.05 and least.again(least.result) and not besides


@pytest.mark.parametrize("budget", [1, 13, 40])
def test_the_budget_is_kept_to_the_run(budget: int) -> None:
    asked: list[RunSpec] = []

    def counting(specs: Sequence[RunSpec]) -> list[RunResult]:
        asked.extend(specs)
        return [RunResult("points", "reached", 1, 1, seconds=50.0, clearance_m=1.0) for _ in specs]

    driven = sum(one.cost for one in searched(CAMPAIGN, Goal.COLLISION, budget, counting))
    assert driven == len(asked) == budget


def a_find(*names: str) -> Find:
    base = first_bases(CAMPAIGN)[0]
    values = {"off_model": 0.1, "noise_m": 0.05, "dropout": 0.1}
    result = RunResult("points", "reached", 1, 1, touched=1)
    return Find(Goal.COLLISION, base, genes_of(CAMPAIGN, base), {name: values[name] for name in names}, result)


def present(spec: RunSpec) -> frozenset[str]:
    changes = SensorSpec.of(spec.sensors).changes.model_dump(exclude_none=True)
    return frozenset([*changes, *(["off_model"] if spec.off_model else [])])


def test_what_could_not_be_put_back_is_tried_again_when_something_else_has_gone() -> None:
    """One pass left two values where one was enough."""
    wrong = {frozenset(one) for one in (("off_model", "noise_m", "dropout"), ("off_model", "dropout"), ("dropout",))}

    def drive(specs: Sequence[RunSpec]) -> list[RunResult]:
        return [RunResult("points", "reached", 1, 1, touched=present(spec) in wrong) for spec in specs]

    left: list[int] = []
    least, _ = minimised(
        a_find("off_model", "noise_m", "dropout"), Goal.COLLISION, drive, lambda find: left.append(len(find.values))
    )
    assert set(least.values) == {"dropout"} and left == [2, 1]


def test_values_without_an_effect_are_put_back_without_a_drive() -> None:
    """Like the time of a fault that does not happen."""
    base, asked = first_bases(CAMPAIGN)[0], list[RunSpec]()
    table = CAMPAIGN.model_copy(update={"search": SearchTable(parts=["faults"])})
    values = {"wheel_slip.start_s": 12.0, "gps_loss.start_s": 3.0, "pilot.duration_s": 4.0}
    find = Find(Policy.NO_CONTACT, base, genes_of(table, base), values, RunResult("points", "collision", touched=1))

    def drive(specs: Sequence[RunSpec]) -> list[RunResult]:
        asked.extend(specs)
        return [RunResult("points", "collision", touched="pilot" in spec.faults) for spec in specs]

    least, _ = minimised(find, Goal.STUCK, drive)
    assert set(least.values) == {"pilot.duration_s"} and {spec.faults for spec in asked} == {"none"}


def test_what_breaks_another_rule_on_the_way_is_a_find_too() -> None:
    def drive(specs: Sequence[RunSpec]) -> list[RunResult]:
        return [RunResult("points", "reached", 1, 1, refused="dropout" not in present(spec)) for spec in specs]

    least, besides = minimised(a_find("dropout"), Goal.COLLISION, drive)
    assert set(least.values) == {"dropout"} and {one.rule for one in besides} == {Policy.NOTHING_REFUSED}
    assert besides[0].again(besides[0].result) and not besides[0].values


def test_a_find_is_written_as_a_campaign_of_one_run_the_same(finds: list[Find], tmp_path: Path) -> None:
    least, _ = minimised(finds[0], Goal.COLLISION, made_up)
    file = tmp_path / "found" / "one.toml"
    spec = counted_from(least.spec, tmp_path / "c.toml", file.parent)
    write_find(least, spec, file, "rover-sitl campaign c.toml --search collision")
    assert list(specs_of(load_campaign(file))) == [spec] == [least.spec]
    assert "dropout=" in differences(least)


def test_files_of_a_find_count_from_its_own_folder(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text("[[target]]\nnorth_m = 1.0\neast_m = 2.0\n")
    table = CampaignTable(worlds=["yard.toml"])
    base = first_bases(table)[0]
    find = Find(Goal.STUCK, base, (), {}, made_up([base])[0])
    file = tmp_path / "a" / "b" / "one.toml"
    write_find(find, counted_from(base, tmp_path / "c.toml", file.parent), file, "...")
    assert load_campaign(file).worlds == ["../../yard.toml"]


@pytest.mark.parametrize(
    ("goal", "result", "is_shown"),
    [
        (Goal.COLLISION, RunResult("points", "collision", touched=1), True),
        (Goal.COLLISION, RunResult("points", "reached", clearance_m=0.01), False),
        (Goal.CLEARANCE, RunResult("points", "reached", clearance_m=0.01), True),
        (Goal.CLEARANCE, RunResult("", "no-ground"), False),
        (Goal.CLEARANCE, RunResult("", "error"), False),
        (Goal.STUCK, RunResult("points", "time limit", targets=1, bound_s=20.0), True),
        (Goal.STUCK, RunResult("points", "time limit", targets=1, bound_s=20.0, waits_for="a person"), False),
        (Goal.STUCK, RunResult("points", "time limit", targets=1, bound_s=0.0), False),
        (Goal.UNREACHABLE, RunResult("points", "incomplete", unreachable=1, called_wrongly=1), True),
        (Goal.UNREACHABLE, RunResult("points", "incomplete", unreachable=1, bound_s=20.0), False),
        (Goal.REFUSED, RunResult("points", "reached", refused=1), True),
    ],
)
def test_what_a_goal_looks_for(goal: Goal, result: RunResult, is_shown: bool) -> None:
    assert shows(goal, result) == is_shown
    usual = RunResult("points", "reached", 1, 1, seconds=40.0, bound_s=20.0, clearance_m=1.0)
    assert not shows(goal, usual) and (not is_shown or distance(goal, result) < distance(goal, usual))


def test_rules_that_are_broken_besides_are_finds_too() -> None:
    def failing(specs: Sequence[RunSpec]) -> list[RunResult]:
        return [RunResult("points", "reached", 1, 1, refused=1, seconds=9.0, clearance_m=1.0) for _ in specs]

    found = next(searched(CAMPAIGN, Goal.COLLISION, 10, failing)).finds
    assert {find.rule for find in found} == {Policy.NOTHING_REFUSED}
