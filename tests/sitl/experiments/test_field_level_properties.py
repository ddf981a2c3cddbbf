"""What must hold for every world, driven field by field: the navigator with a complete planner never fails."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid
from companion.navigation.field_step import simplified
from companion.planning.graph_search.dijkstra import Dijkstra
from companion.planning.problem import Budget, PlanningProblem, PlanStatus
from companion.settings import Settings
from sitl.experiments.field_level import Outcome, drive_fields
from tests.support.paths import is_path
from tests.support.quick import examples

PLACES = st.tuples(st.integers(0, 13), st.integers(0, 10)).map(lambda place: Cell(*place))


@st.composite
def worlds(draw):
    """Random ground of 14 x 11 fields from nearly free to nearly closed, with a start and a target that are free."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    weights = np.where(rng.random((11, 14)) < draw(st.floats(0.0, 0.6)), OBSTACLE, BASE_WEIGHT)
    start, target = draw(PLACES), draw(PLACES)
    weights[start.y, start.x] = weights[target.y, target.x] = BASE_WEIGHT
    return Grid(weights), start, target


@settings(max_examples=examples(150), deadline=None)
@given(world=worlds(), seed=st.integers(0, 1000))
def test_the_target_is_reached_if_and_only_if_there_is_a_way(world, seed):
    truth, start, target = world
    run = drive_fields(truth, start, target, Settings(), seed)
    problem = PlanningProblem(truth.weights, start, target)
    known = Dijkstra(Settings().planner).plan(problem, Budget(), np.random.default_rng(0))
    reachable = known.status is PlanStatus.FOUND
    assert run.outcome is (Outcome.REACHED if reachable else Outcome.UNREACHABLE)
    assert run.track[-1] == (target if reachable else start), "in vain it is back where it started"
    assert is_path(truth.weights, run.track), "from field to field, through no obstacle and past no corner"
    assert len(run.track) == run.steps + 1 == len(run.parts) + 1


@settings(max_examples=30, deadline=None)
@given(world=worlds(), seed=st.integers(0, 1000))
def test_a_run_is_a_function_of_its_seed(world, seed):
    first, second = (drive_fields(*world, Settings(), seed) for _ in range(2))
    assert (first.track, first.parts, first.outcome) == (second.track, second.parts, second.outcome)
    assert (first.searches, first.return_steps) == (second.searches, second.return_steps)


@given(st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1)).filter(any), max_size=60))
def test_a_simplified_walk_is_a_walk_without_loops(moves):
    walk = [Cell(0, 0)]
    for x, y in moves:
        walk.append(Cell(walk[-1].x + x, walk[-1].y + y))
    result = simplified(tuple(walk))
    assert (result[0], result[-1]) == (walk[0], walk[-1])
    assert len(set(result)) == len(result) and set(result) <= set(walk)
    assert all(max(abs(a.x - b.x), abs(a.y - b.y)) == 1 for a, b in pairwise(result))
    assert simplified(result) == result
