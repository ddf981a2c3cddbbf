"""Islands: what they find depends on the seed and on their number, never on the number of threads."""

import numpy as np
import pytest

from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.problem import Budget
from companion.settings import PlannerSettings
from tests.companion.planning.test_hybrid import maze
from tests.support.planning_maps import one_obstacle


def plan(problem, budget, seed, **changes):
    return BsplineGa(PlannerSettings(**changes)).plan(problem, budget, np.random.default_rng(seed))


def outcome(result):
    path = result.path
    return result.status, result.epochs, result.evaluations, path and (path.cells, path.cost)


@pytest.mark.parametrize("adaptive", [False, True])
def test_the_number_of_threads_changes_nothing(adaptive):
    budget = Budget(13, 60, (4, 5), 24)
    for seed in range(6):
        for problem in (one_obstacle(), maze()):
            results = [
                outcome(plan(problem, budget, seed, islands=4, migrate_every=5, threads=threads, adaptive=adaptive))
                for threads in (1, 2, 4)
            ]
            assert results[0] == results[1] == results[2]


def test_every_island_spends_the_budget():
    result = plan(maze(), Budget(1, 33, (4, 5), 24), 0, islands=3, migrate_every=5)
    assert result.path is None and result.epochs == 66
    assert result.evaluations == 2 * 3 * (24 + 32 * 18)


def test_migration_counts():
    problem, budget = one_obstacle(), Budget(40, 60, (4,), 24)
    problem.weights[problem.weights < 1.0] *= np.random.default_rng(1).random(np.sum(problem.weights < 1.0))
    apart = [plan(problem, budget, seed, islands=3, migrate_every=60).path.cells for seed in range(5)]
    together = [plan(problem, budget, seed, islands=3, migrate_every=5).path.cells for seed in range(5)]
    assert apart != together


def test_more_islands_find_more():
    weights = np.full((50, 100), 0.5)
    for x, gap in ((33, 10), (66, 40)):
        weights[:, x] = 1.0
        weights[gap - 3 : gap + 4, x] = 0.5
    start = one_obstacle()
    problem = type(start)(weights, start.start, start.target)

    def found(islands):
        budget = Budget(1, 40, (5,), 24)
        return sum(plan(problem, budget, seed, islands=islands).path is not None for seed in range(60))

    alone, four = found(1), found(4)
    # Measured: 4 islands find far more; chance alone would have to lift them by three standard deviations.
    assert four >= alone + 3 * 4
