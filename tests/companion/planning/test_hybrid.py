import math

import numpy as np
import pytest

from companion.core.grid import Cell
from companion.planning.problem import Budget, KinematicConstraints, PlanningProblem, PlanStatus
from companion.planning.registry import PLANNERS, UnknownPlannerError, make_planner, warm_up
from companion.planning.smoothing import curve_cost
from companion.settings import PlannerSettings
from tests.support.planning_maps import one_obstacle

BUDGET = Budget(3, 40, (4, 6), 30)


def plan(name, problem, seed=0):
    return make_planner(name, PlannerSettings()).plan(problem, BUDGET, np.random.default_rng(seed))


def driving_cost(problem, result):
    return curve_cost(problem.weights, result.path.curve)


def maze():
    """Walls with gaps at alternating ends, too many for so few control points."""
    weights = np.full((50, 100), 0.5)
    for i, x in enumerate(range(8, 96, 8)):
        weights[:, x] = 1.0
        weights[2 if i % 2 else 47, x] = 0.5
    return PlanningProblem(weights, Cell(0, 24), Cell(98, 24))


def test_open_ground_is_mostly_the_genetic_algorithms():
    problem = PlanningProblem(np.full((50, 100), 0.5), Cell(0, 24), Cell(98, 24))
    results = [plan("hybrid", problem, seed) for seed in range(40)]
    assert all(driving_cost(problem, result) <= 1.01 * 49.0 + 1e-9 for result in results)
    # If a search has even odds, fewer than 8 of 40 happen once in 20,000 times.
    assert sum(result.control_points == 4 for result in results) >= 8


def test_driving_there_never_costs_much_more_than_the_shortest_way():
    problem = one_obstacle()
    best = driving_cost(problem, plan("theta-star", problem))
    for seed in range(20):
        result = plan("hybrid", problem, seed)
        assert result.status is PlanStatus.FOUND and result.planner == "hybrid"
        assert driving_cost(problem, result) <= 1.03 * best


def test_hard_maps_get_the_graphs_path_after_a_look():
    assert plan("bspline-ga", maze()).status is PlanStatus.BUDGET_SPENT
    result = plan("hybrid", maze())
    assert result.status is PlanStatus.FOUND and result.control_points == 0
    assert driving_cost(maze(), result) <= 1.03 * driving_cost(maze(), plan("theta-star", maze()))
    assert result.epochs == 3


def test_who_cannot_turn_on_the_spot_gets_the_genetic_path_unless_it_is_far_dearer():
    weights = np.full((50, 100), 0.5)
    ahead = PlanningProblem(weights, Cell(10, 24), Cell(90, 24), kinematics=KinematicConstraints(0.0, 4.0))
    behind = PlanningProblem(weights, Cell(50, 24), Cell(10, 24), kinematics=KinematicConstraints(0.0, 4.0))
    for seed in range(20):
        assert plan("hybrid", ahead, seed).path.cost <= 1.03 * 40.0 + 1e-9
        # Half a turn of 4 fields' radius costs 6.3, and as much again is allowed for.
        assert plan("hybrid", behind, seed).path.cost <= 1.03 * 20.0 + 4.0 * math.pi + 1e-9
    # Through the maze the genetic algorithm finds no way: the graph's is better than none.
    problem = maze()
    result = plan(
        "hybrid",
        PlanningProblem(problem.weights, problem.start, problem.target, kinematics=KinematicConstraints(0.0, 4.0)),
    )
    assert result.status is PlanStatus.FOUND
    assert result.path.cost <= 1.03 * plan("dijkstra", problem).path.cost


def test_sealed_targets_cost_a_look_and_the_proof_only():
    problem = maze()
    problem.weights[:, 48] = 1.0
    result = plan("hybrid", problem)
    assert result.status is PlanStatus.NO_PATH and result.path is None
    assert result.epochs == 3


def test_an_unknown_planner_is_named_with_the_nearest():
    with pytest.raises(UnknownPlannerError, match="'dijkstar', did you mean 'dijkstra'") as error:
        make_planner("dijkstar", PlannerSettings())
    assert all(name in str(error.value) for name in PLANNERS)
    with pytest.raises(UnknownPlannerError, match="unknown planner 'rrt'; known: bspline-ga") as error:
        make_planner("rrt", PlannerSettings())
    assert "did you mean" not in str(error.value)


def test_warm_up_compiles_what_plans_use():
    from companion.planning.bspline_ga import planner as bspline_ga
    from companion.planning.graph_search import dijkstra

    warm_up()
    compiled = len(bspline_ga.search.signatures), len(dijkstra.shortest.signatures)
    assert min(compiled) >= 1
    for name in PLANNERS:
        plan(name, one_obstacle())
    assert (len(bspline_ga.search.signatures), len(dijkstra.shortest.signatures)) == compiled
