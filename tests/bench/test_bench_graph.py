"""Graph search beside its peers, by size of the map. Ratios hold within one run only; ``make bench`` prints them."""

import statistics
import time

import numpy as np
import pytest

from companion.bench.peers import installed_peers
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner, warm_up
from companion.settings import PlannerSettings
from tests.support.planning_maps import one_obstacle

GRAPH = ("astar", "dijkstra", "theta-star", "dstar-lite")
PEERS = {"nano_astar": "nano-astar", "tcod": "tcod", "skimage": "scikit-image"}
RNG = np.random.default_rng(0)
ROUNDS = {1: 300, 4: 40, 10: 10, 40: 3}


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def solve_with(name, problem):
    """One whole search by a planner of ours, made anew: some remember."""
    planner = make_planner(name, PlannerSettings())
    return planner.plan(problem, Budget(), RNG)


def peer(module):
    """The peer's contestant; skips where it is not installed."""
    pytest.importorskip(module)
    return next(entry for entry in installed_peers()[0] if entry.name == PEERS[module])


def medians_s(calls, rounds):
    """Median of each call; they take turns, so that a busy moment of the machine hits all of them."""
    seconds = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(rounds):
        for name, call in calls.items():
            began_s = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - began_s)
    return {name: statistics.median(values) for name, values in seconds.items()}


@pytest.mark.parametrize("factor", [1, 4, 10])
@pytest.mark.parametrize("name", GRAPH)
def test_one_obstacle(benchmark, name, factor):
    problem = one_obstacle(factor)
    result = benchmark.pedantic(lambda: solve_with(name, problem), rounds=ROUNDS[factor], warmup_rounds=1)
    assert result.path is not None


@pytest.mark.parametrize("module", PEERS)
def test_peer_one_obstacle(benchmark, module):
    contestant, problem = peer(module), one_obstacle()
    found = benchmark(lambda: contestant.solve(problem.weights, problem.start, problem.target, RNG))
    assert found is not None


def ratio_to(module, factor):
    contestant, problem = peer(module), one_obstacle(factor)
    seconds = medians_s(
        {
            "astar": lambda: solve_with("astar", problem),
            module: lambda: contestant.solve(problem.weights, problem.start, problem.target, RNG),
        },
        ROUNDS[factor],
    )
    ratio = seconds[module] / seconds["astar"]
    print(
        f"\n{100 * factor} x {50 * factor}: astar {seconds['astar'] * 1e3:.4f} ms, {module} {ratio:.2f} times as long"
    )
    return ratio


@pytest.mark.parametrize("factor", [1, 4, 10, 40])
def test_astar_is_three_times_as_fast_as_nano_astar(factor):
    assert ratio_to("nano_astar", factor) >= 3.0


def test_astar_is_three_times_as_fast_as_tcod_and_scikit_image_on_a_small_map():
    assert ratio_to("tcod", 1) >= 3.0
    assert ratio_to("skimage", 1) >= 3.0


def test_dstar_lites_repair_takes_a_fraction_of_its_search():
    problem, planner = one_obstacle(10), make_planner("dstar-lite", PlannerSettings())
    rng = np.random.default_rng(0)
    planner.plan(problem, Budget(), rng)
    weights, ratios = problem.weights.copy(), []
    path = planner.plan(problem, Budget(), rng).path
    for i in range(10):
        x, y = path.cells[20]
        weights[y, x] = 1.0
        changed = PlanningProblem(weights, path.cells[i % 3], problem.target)
        seconds = medians_s({"anew": lambda c=changed: solve_with("dstar-lite", c)}, 1)["anew"]
        began_s = time.perf_counter()
        path = planner.plan(changed, Budget(), rng).path
        ratios.append((time.perf_counter() - began_s) / seconds)
    print(f"\n1000 x 500, repair / new search: {statistics.median(ratios):.4f}")
    assert statistics.median(ratios) <= 0.2
