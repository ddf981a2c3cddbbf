"""Every planner there is, held to the contract of ``Planner.plan``."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from companion.core.grid import Cell
from companion.planning.contract_problems import BUDGET, random_problem, tasks_for
from companion.planning.planner import Capabilities, RandomPlanner
from companion.planning.planner_contract import broken_by, reachable
from companion.planning.problem import Path, PlanningProblem
from companion.planning.registry import PLANNERS, make_planner
from companion.settings import PlannerSettings
from tests.support.paths import is_path
from tests.support.quick import examples

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


@pytest.mark.parametrize("name", PLANNERS)
def test_what_capabilities_promise_is_kept(name):
    planner = make_planner(name, SETTINGS)
    for number in range(20):
        for problem, budget in tasks_for(planner.capabilities, number)[1:]:
            assert broken_by(planner, problem, budget, number) == "", number


class Broken(RandomPlanner):
    """The paths of a good planner, with a line or speeds of its own, and promises that it does not keep."""

    name = "broken"

    def __init__(self, promised, inner="astar", line=None, speed=None):
        self.capabilities, self.line, self.speed = Capabilities(**dict.fromkeys(promised, True)), line, speed
        self.inner = make_planner(inner, SETTINGS)

    def _search(self, problem, weights, budget, seed):
        path = self.inner.plan(problem, budget, np.random.default_rng(seed)).path
        curve = self.line(problem) if self.line else path and path.curve
        speeds = self.speed and np.full(len(curve) - 1, self.speed)
        return path and Path(path.cells, path.cost, curve, speeds), 1, 0, 0


def straight(problem):
    return np.array((problem.start, problem.target), float)


def nowhere(problem):
    return np.empty((0, 2))


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        (Broken(["any_angle"], line=straight), "its curve is the line to drive, and has a fault: "),
        (Broken(["smooth_curve"], line=straight), "fields away from its path"),
        (Broken(["any_angle"], line=nowhere), "does not begin at the start"),
        (Broken(["optimal"], "prm"), "its capabilities say neither smooth_curve nor any_angle"),
        (Broken(["optimal", "any_angle"], "prm"), "it promises optimal, and its path costs"),
        (Broken(["moving_obstacles"]), "it promises moving_obstacles, and it meets one"),
        (Broken(["moving_obstacles", "any_angle"], "vertex"), "it promises moving_obstacles, and it meets one"),
        (Broken(["turning_radius"]), "tighter than the radius"),
        (Broken(["turning_radius", "any_angle"], "theta-star"), "its line sets out"),
        (Broken(["any_angle", "speeds"], "theta-star"), "without speeds"),
        (Broken(["any_angle"], "theta-star", speed=1.0), "it gives speeds, and"),
        (Broken(["any_angle", "speeds"], "theta-star", speed=3.0), "it gives a speed outside 0.2 to 2 fields/s"),
    ],
)
def test_broken_planners_are_found(broken, says):
    tasks = [(number, *task) for number in range(30) for task in tasks_for(broken.capabilities, number)]
    assert any(says in broken_by(broken, problem, budget, number) for number, problem, budget in tasks)


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
