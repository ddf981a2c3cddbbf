"""Vehicles that cannot turn on the spot: what the genetic algorithm finds, they can drive."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Cell
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.bspline_ga.turning import greatest_curvature_per_field
from companion.planning.problem import Budget, KinematicConstraints, PlanningProblem
from companion.settings import PlannerSettings
from tests.support.planning_maps import one_obstacle
from tests.support.quick import examples

BUDGET = Budget(1, 300, (4, 5, 6, 8), 60)
FINE = 20_000


def plan(problem, seed, budget=BUDGET, **changes):
    return BsplineGa(PlannerSettings(**changes)).plan(problem, budget, np.random.default_rng(seed))


def turning(problem, radius, heading=None):
    return PlanningProblem(
        problem.weights, problem.start, problem.target, kinematics=KinematicConstraints(heading, radius)
    )


def greatest_curvature(line):
    """Of a finely sampled line, by finite differences: change of direction over length."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(np.diff(headings) / (0.5 * (lengths[1:] + lengths[:-1]))).max())


@settings(deadline=None, max_examples=examples(100))
@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), min_size=3, max_size=7))
def test_the_sharpest_curvature_is_that_of_a_fine_line(points):
    control = np.array(points, float)
    exact = max(greatest_curvature_per_field(control, span) for span in range(len(control) - 2))
    if exact > 2.0:  # nearly a cusp: differences over finite lengths cannot see it
        return
    line = bspline.curve(control, FINE)
    assert greatest_curvature(line) == pytest.approx(exact, rel=0.05, abs=2e-3)


@pytest.mark.parametrize(("radius", "heading"), [(5.0, None), (8.0, 0.0), (8.0, 1.2), (5.0, math.pi)])
def test_what_is_found_can_be_driven(radius, heading):
    ground = one_obstacle()
    problem = turning(PlanningProblem(ground.weights, Cell(20, 24), ground.target), radius, heading)
    found = 0
    for seed in range(20):
        path = plan(problem, seed).path
        if path is None:
            continue
        found += 1
        curve = path.curve
        assert curve is not None and curve[[0, -1]] == pytest.approx(np.array([problem.start, problem.target]))
        # Two samples a field: over so long a chord the direction says less than 1 % too little or too much.
        assert greatest_curvature(curve) <= 1.02 / radius
        if heading is not None:
            step = curve[1] - curve[0]
            off = math.remainder(math.atan2(step[1], step[0]) - heading, 2.0 * math.pi)
            assert abs(off) <= 0.6 * float(np.hypot(*step)) / radius + 1e-9
        nearest = np.floor(curve + 0.5).astype(int)
        assert (problem.weights[nearest[:, 1], nearest[:, 0]] < 1.0).all()
    # If a search has odds of 97 %, fewer than 17 of 20 happen once in 3,000 times.
    assert found >= 17


def test_without_a_radius_turns_are_sharper_and_the_heading_does_not_count():
    free, held = one_obstacle(), turning(one_obstacle(), 0.0, 2.0)
    sharp = 0
    for seed in range(20):
        result, same = plan(free, seed, Budget()), plan(held, seed, Budget())
        assert result.path.cells == same.path.cells
        if result.path.curve is not None:
            sharp += greatest_curvature(result.path.curve) > 1.02 / 8.0
    assert sharp >= 5


def test_a_gap_beside_the_rover_is_too_tight_a_turn():
    weights = np.full((30, 9), 0.5)
    weights[:, 4] = 1.0
    weights[14:17, 4] = 0.5
    problem = PlanningProblem(weights, Cell(1, 3), Cell(7, 3))
    budget = Budget(1, 60, (4, 5, 6), 60)
    assert plan(problem, 1, budget).path is not None
    for seed in range(5):
        assert plan(turning(problem, 12.0), seed, budget).path is None
