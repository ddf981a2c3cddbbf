"""One plan, by planner and by size of the map. Ratios hold within one run only; ``make bench`` prints them."""

import statistics
import time

import networkx as nx
import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra as scipy_dijkstra

from companion.planning.problem import MIN_WEIGHT, Budget
from companion.planning.registry import PLANNERS, make_planner, warm_up
from companion.settings import PlannerSettings
from tests.support.planning_maps import one_obstacle

FACTORS = (1, 4, 10, 40)


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def median_s(planner, problem, rounds):
    """Median of whole calls of ``plan``, with a fresh stretch of random numbers each."""
    rng = np.random.default_rng(1)
    seconds = []
    for _ in range(rounds):
        began_s = time.perf_counter()
        planner.plan(problem, Budget(), rng)
        seconds.append(time.perf_counter() - began_s)
    return statistics.median(seconds)


@pytest.mark.parametrize("name", PLANNERS)
def test_one_obstacle(benchmark, name):
    problem, planner, rng = one_obstacle(), make_planner(name, PlannerSettings()), np.random.default_rng(1)
    result = benchmark(lambda: planner.plan(problem, Budget(), rng))
    # Row by row there is no way round this obstacle; what is measured is how long it takes to give up.
    assert (result.path is None) == (name == "geisler")


def steps(problem):
    """The same graph as arrays for the libraries: sources, ends, costs."""
    weights = problem.weights
    height, width = weights.shape
    number = np.arange(weights.size).reshape(weights.shape)
    free = weights < 1.0
    rows, columns, costs = [], [], []
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        here = (slice(max(0, -dy), height - max(0, dy)), slice(max(0, -dx), width - max(0, dx)))
        there = (slice(max(0, dy), height + min(0, dy)), slice(max(0, dx), width + min(0, dx)))
        beside_x, beside_y = (here[0], there[1]), (there[0], here[1])
        open_steps = free[here] & free[there] & free[beside_x] & free[beside_y]
        rows.append(number[here][open_steps])
        columns.append(number[there][open_steps])
        costs.append(np.maximum(weights[there][open_steps], MIN_WEIGHT) * np.hypot(dx, dy))
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)


def test_scipy_one_obstacle(benchmark):
    problem = one_obstacle()
    rows, columns, costs = steps(problem)
    graph = csr_matrix((costs, (rows, columns)), shape=(problem.weights.size,) * 2)
    start, target = (cell.y * 100 + cell.x for cell in (problem.start, problem.target))
    distances = benchmark(lambda: scipy_dijkstra(graph, indices=start))
    own = make_planner("dijkstra", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0))
    assert distances[target] == pytest.approx(own.path.cost)


def test_networkx_one_obstacle(benchmark):
    problem = one_obstacle()
    graph = nx.DiGraph()
    graph.add_weighted_edges_from(zip(*(part.tolist() for part in steps(problem)), strict=True))
    start, target = (cell.y * 100 + cell.x for cell in (problem.start, problem.target))
    cost = benchmark.pedantic(lambda: nx.dijkstra_path_length(graph, start, target), rounds=5)
    own = make_planner("dijkstra", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0))
    assert cost == pytest.approx(own.path.cost)


def test_genetic_algorithm_takes_at_most_half_of_graph_search():
    problem = one_obstacle()
    names = ("bspline-ga", "hybrid", "dijkstra", "astar")
    seconds = {name: median_s(make_planner(name, PlannerSettings()), problem, 3000) for name in names}
    ratio = seconds["bspline-ga"] / seconds["dijkstra"]
    print("\none obstacle, 100 x 50, median of whole plans:")
    for name, value in seconds.items():
        print(f"  {name:12} {value * 1e3:8.4f} ms")
    print(f"  GA / Dijkstra {ratio:.2f}")
    assert ratio <= 0.5


def test_curve_over_the_size_of_the_map():
    print("\nfactor   fields          GA ms  Dijkstra ms   GA/Dijkstra")
    ratios, genetic = [], []
    for factor in FACTORS:
        problem = one_obstacle(factor)
        ga = median_s(make_planner("bspline-ga", PlannerSettings()), problem, 200)
        graph = median_s(make_planner("dijkstra", PlannerSettings()), problem, 3 if factor > 10 else 30)
        genetic.append(ga)
        ratios.append(ga / graph)
        print(f"{factor:6} {100 * factor:5} x {50 * factor:<5} {ga * 1e3:9.4f} {graph * 1e3:12.4f} {ratios[-1]:13.4f}")
    assert ratios == sorted(ratios, reverse=True)
    assert genetic[-1] / genetic[0] < 60.0


def test_islands_share_the_work_of_a_search_that_finds_nothing():
    problem = one_obstacle()
    problem.weights[:, 50] = 1.0
    budget = Budget(1, 200, (8,), 60)
    print("\nfour islands, 200 epochs without a path, median of whole plans:")
    for threads in (1, 2):
        planner = make_planner("bspline-ga", PlannerSettings(islands=4, migrate_every=20, threads=threads))
        rng = np.random.default_rng(1)
        seconds = []
        for _ in range(20):
            began_s = time.perf_counter()
            result = planner.plan(problem, budget, rng)
            seconds.append(time.perf_counter() - began_s)
        assert result.epochs == 200 and result.evaluations == 4 * (60 + 199 * 45)
        print(f"  {threads} threads {statistics.median(seconds) * 1e3:8.2f} ms")
