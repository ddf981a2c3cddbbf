"""Every planner there is, held to the contract of ``Planner.plan``."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from companion.core.grid import Cell
from companion.planning.problem import Budget, PlanningProblem, PlanStatus, path_cost
from companion.planning.raster import FAULTS, PathFault, first_fault, plain
from companion.planning.registry import PLANNERS, make_planner
from companion.settings import PlannerSettings
from tests.support.paths import is_path

BUDGET = Budget(min_epochs=2, max_epochs=15, control_points=(4, 6), population=18)
SETTINGS = PlannerSettings.model_validate({"sedighi": {"population": 20, "generations": 40}})
EIGHT, FOUR = np.ones((3, 3)), None


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


def reachable(problem: PlanningProblem) -> bool:
    """By flood fill. Without corner cutting a diagonal step is never the only way, so four neighbours are enough."""
    height, width = problem.weights.shape
    for cell in (problem.start, problem.target):
        if not (0 <= cell.x < width and 0 <= cell.y < height) or problem.weights[cell.y, cell.x] >= 1.0:
            return False
    regions, _ = label(problem.weights < 1.0, EIGHT if problem.corner_cutting else FOUR)
    return bool(regions[problem.start.y, problem.start.x] == regions[problem.target.y, problem.target.x])


@pytest.mark.parametrize("name", PLANNERS)
@given(problem=problems(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=120, deadline=None)  # enough for planted faults of one condition in one kernel
def test_contract(name, problem, seed):
    planner = make_planner(name, SETTINGS)
    before = problem.weights.copy()
    result = planner.plan(problem, BUDGET, np.random.default_rng(seed))
    again = planner.plan(problem, BUDGET, np.random.default_rng(seed))

    assert np.array_equal(problem.weights, before)
    assert result.planner == name == planner.name
    assert (result.path is not None) == (result.status is PlanStatus.FOUND)
    assert result.status == again.status and result.epochs == again.epochs
    if planner.capabilities.proves_no_path:
        assert result.status is (PlanStatus.FOUND if reachable(problem) else PlanStatus.NO_PATH)
    else:
        assert result.status is not PlanStatus.NO_PATH
    if result.path is None:
        return
    assert again.path is not None and again.path.cells == result.path.cells and again.path.cost == result.path.cost
    cells = result.path.cells
    assert cells[0] == problem.start and cells[-1] == problem.target
    number, index = first_fault(plain(problem.weights), result.path.cell_array, problem.corner_cutting)
    assert FAULTS[number] is PathFault.NONE, f"{FAULTS[number]} at {index}"
    assert len(set(cells)) == len(cells)
    assert result.path.cost == pytest.approx(path_cost(problem.weights, cells), rel=1e-9)
    if result.path.curve is not None:
        assert planner.capabilities.smooth_curve or planner.capabilities.any_angle
        assert result.path.curve[0] == pytest.approx(problem.start) and result.path.curve[-1] == pytest.approx(
            problem.target
        )


@given(problem=problems(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
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


def test_is_path_agrees_on_a_known_case():
    assert is_path(np.full((2, 2), 0.5), [Cell(0, 0), Cell(1, 1)])
