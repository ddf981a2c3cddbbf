"""The B-spline genetic algorithm's extensions keep the contract of every planner."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.problem import KinematicConstraints, PlanStatus, path_cost
from companion.planning.raster import first_fault, plain
from companion.settings import PlannerSettings
from tests.companion.planning.test_planner_contract import BUDGET, problems
from tests.support.quick import examples

VARIANTS = {
    "adaptive": {"adaptive": True},
    "few at most": {"adaptive": True, "most_control_points": 4},
    "islands": {"islands": 3, "migrate_every": 4},
    "all": {"adaptive": True, "islands": 2, "migrate_every": 1, "threads": 1},
}
any_kinematics = st.builds(
    KinematicConstraints, st.one_of(st.none(), st.floats(-4.0, 4.0)), st.sampled_from([0.0, 0.7, 2.0, 50.0])
)


@pytest.mark.parametrize("name", VARIANTS)
@given(problem=problems(), kinematics=any_kinematics, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(120), deadline=None)
def test_contract(name, problem, kinematics, seed):
    planner = BsplineGa(PlannerSettings(**VARIANTS[name]))
    problem = replace(problem, kinematics=kinematics)
    before = problem.weights.copy()
    result = planner.plan(problem, BUDGET, np.random.default_rng(seed))
    again = planner.plan(problem, BUDGET, np.random.default_rng(seed))
    assert np.array_equal(problem.weights, before)
    assert result.status is not PlanStatus.NO_PATH
    assert (result.status, result.epochs) == (again.status, again.epochs)
    if result.path is None:
        return
    cells = result.path.cells
    assert cells == again.path.cells and len(set(cells)) == len(cells)
    assert cells[0] == problem.start and cells[-1] == problem.target
    assert first_fault(plain(problem.weights), result.path.cell_array, problem.corner_cutting)[0] == 0
    assert result.path.cost == pytest.approx(path_cost(problem.weights, cells), rel=1e-9)
    if kinematics.turning_radius_fields > 0.0 and problem.start != problem.target:
        assert result.path.curve is not None
