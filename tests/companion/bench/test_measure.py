"""What is measured, and that nobody is flattered."""

import numpy as np
import pytest

from companion.bench.cases import Case
from companion.bench.contestants import Contestant, our_planner
from companion.bench.measure import Limits, measure, spread_order
from companion.core.grid import Cell
from companion.planning.problem import Budget
from companion.settings import PlannerSettings
from tests.support.planning_maps import drawn

WALL = drawn("........", "....#...", "....#...", "....#...", "........", "....#...")


CASE = Case("wall", 1, WALL, ((Cell(0, 2), Cell(7, 2)),))


def run(contestant: Contestant, seeds: int = 4):
    (entry,) = measure([contestant], [CASE], Limits(seeds=seeds), lambda *_: None)
    return entry


def test_an_optimal_planner_costs_what_is_possible():
    entry = run(our_planner("dijkstra", PlannerSettings(), Budget()))
    assert entry.found == entry.runs == 20 and entry.ratio == 1.0 and entry.faults == ()
    assert 0.0 < entry.median_ms <= entry.p99_ms


def test_a_random_planner_is_measured_over_seeds():
    entry = run(our_planner("bspline-ga", PlannerSettings(), Budget()), seeds=7)
    assert entry.runs == 7 and all(ratio >= 1.0 - 1e-9 for ratio in entry.ratios)


@pytest.mark.parametrize(
    ("cells", "fault"),
    [
        ([(x, 2) for x in range(8)], "obstacle"),
        ([(0, 2), (1, 2), (2, 2), (3, 2), (4, 1), (5, 2), (6, 2), (7, 2)], "corner cut"),
        ([(0, 2), (7, 2)], "not adjacent"),
        ([(0, 2), (1, 2)], "wrong ends"),
    ],
)
def test_faults_of_others_are_found(cells, fault):
    entry = run(Contestant("cheat", lambda *_: lambda: np.array(cells, np.int64)))
    assert fault in entry.faults


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9, 20, 21])
def test_every_problem_comes_once_and_a_hard_one_soon(count):
    order = spread_order(count)
    assert sorted(order) == list(range(count))
    assert max(order[: (count + 2) // 3 + 1]) >= count // 2


def test_a_random_planner_meets_every_problem_however_few_the_seeds():
    asked = []

    def solve(weights, start, target, rng):
        asked.append((start, target))

    ends = tuple((Cell(0, y), Cell(7, y)) for y in range(5))
    measure([Contestant("any", solve, random=True)], [Case("wall", 1, WALL, ends)], Limits(seeds=2), lambda *_: None)
    assert set(asked) == set(ends)


def test_what_finds_nothing_has_no_cost():
    entry = run(Contestant("blind", lambda *_: None))
    assert entry.found == 0 and entry.ratio is None


def test_a_contestant_that_would_take_too_long_is_not_sent_to_larger_maps():
    slow = Contestant("small maps only", lambda *_: None, most_fields=10)
    assert measure([slow], [CASE], Limits(), lambda *_: None) == []
