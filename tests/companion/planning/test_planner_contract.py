"""Every planner there is, held to the contract of ``Planner.plan``."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from companion.core.grid import Cell
from companion.planning.planner_contract import broken_by, random_problem, reachable
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import PLANNERS, make_planner
from companion.settings import PlannerSettings
from tests.support.paths import is_path
from tests.support.quick import examples

BUDGET = Budget(min_epochs=2, max_epochs=15, control_points=(4, 6), population=18)
SETTINGS = PlannerSettings.model_validate({"sedighi": {"population": 20, "generations": 40}})


@st.composite
def problems(draw):
    """Mostly solvable ones with many corners: most faults show only where a path is found beside obstacles."""
    width, height = draw(st.integers(1, 14)), draw(st.integers(1, 14))
    seed, share = draw(st.integers(0, 2**32 - 1)), draw(st.sampled_from([0.25, 0.1, 0.4, 0.0]))
    rng = np.random.default_rng(seed)
    ground = draw(st.sampled_from(["even", "rough", "free of cost"]))
    weights = {"even": np.full((height, width), 0.5), "free of cost": np.zeros((height, width))}.get(ground)
    weights = rng.random((height, width)) if weights is None else weights
    weights[rng.random((height, width)) < share] = 1.0
    if draw(st.integers(0, 4)) == 0:  # ends anywhere: on obstacles, outside the map
        start, target = (Cell(draw(st.integers(-1, width)), draw(st.integers(-1, height))) for _ in range(2))
    else:  # free and usually far apart
        low, high = sorted(rng.integers(0, width, 2))
        start, target = Cell(int(low), int(rng.integers(height))), Cell(int(high), int(rng.integers(height)))
        weights[start.y, start.x] = weights[target.y, target.x] = 0.5
    weights.flags.writeable = draw(st.booleans())
    return PlanningProblem(weights, start, target, draw(st.booleans()))


@pytest.mark.parametrize("name", PLANNERS)
@given(problem=problems(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(120), deadline=None)  # enough for planted faults of one condition in one kernel
def test_contract(name, problem, seed):
    planner = make_planner(name, SETTINGS)
    assert planner.name == name
    assert broken_by(planner, problem, BUDGET, seed) == ""


@given(problem=problems(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(100), deadline=None)
def test_nothing_is_cheaper_than_an_optimal_planner(problem, seed):
    results = {
        name: make_planner(name, SETTINGS).plan(problem, BUDGET, np.random.default_rng(seed)) for name in PLANNERS
    }
    optimal = [name for name in PLANNERS if make_planner(name, SETTINGS).capabilities.optimal]
    assert optimal
    for result in results.values():
        if result.path is not None:
            for name in optimal:
                best = results[name].path
                assert best is not None and best.cost <= result.path.cost + 1e-9


def test_a_way_is_known_as_a_library_knows_it():
    """scipy labels regions of the same fields."""
    ways = 0
    for number in range(200):
        problem = random_problem(np.random.default_rng(number))
        regions, _ = label(problem.weights < 1.0, np.ones((3, 3)) if problem.corner_cutting else None)
        (x, y), (to_x, to_y) = problem.start, problem.target
        known = problem.ends_are_free and regions[y, x] == regions[to_y, to_x]
        assert reachable(problem) == known
        ways += known
    assert 60 < ways < 180


def test_is_path_agrees_on_a_known_case():
    assert is_path(np.full((2, 2), 0.5), [Cell(0, 0), Cell(1, 1)])
