"""A*, Theta* and D* Lite beside Dijkstra, which is held to scipy and networkx in its own tests."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Cell, as_cells
from companion.planning.graph_search.astar import Astar
from companion.planning.graph_search.astar_kernel import shortest
from companion.planning.graph_search.dijkstra import Dijkstra
from companion.planning.graph_search.dstar_lite import DstarLite
from companion.planning.graph_search.steps import Query, least_cost
from companion.planning.graph_search.theta_star import Ground, ThetaStar, line_cost, others_before
from companion.planning.problem import MIN_WEIGHT, Budget, PlanningProblem, PlanStatus
from companion.planning.raster import cells_cost, polyline
from companion.settings import PlannerSettings
from tests.support.paths import is_path
from tests.support.planning_maps import drawn, one_obstacle
from tests.support.quick import examples

SETTINGS = PlannerSettings()


def plan(planner, problem):
    return planner.plan(problem, Budget(), np.random.default_rng(0))


def ground(kind, rng, height, width, blocked):
    """Even, rough, mostly cheap or free ground with obstacles."""
    weights = {
        "even": np.full((height, width), 0.5),
        "rough": rng.random((height, width)),
        "cheap": rng.random((height, width)) ** 4,
        "free": np.zeros((height, width)),
    }[kind]
    weights[rng.random((height, width)) < blocked] = 1.0
    return weights


def some_cell(rng, weights):
    height, width = weights.shape
    return Cell(int(rng.integers(width)), int(rng.integers(height)))


@st.composite
def worlds(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    height, width = draw(st.integers(1, 30)), draw(st.integers(1, 30))
    kind, blocked = draw(st.sampled_from(["even", "rough", "cheap", "free"])), draw(st.sampled_from([0.0, 0.15, 0.35]))
    return rng, ground(kind, rng, height, width, blocked), draw(st.booleans())


def assert_as_cheap(found, best):
    assert found.status == best.status
    if best.path is not None:
        assert found.path.cost == pytest.approx(best.path.cost, rel=1e-10)


@given(world=worlds())
@settings(max_examples=examples(400), deadline=None)
def test_astar_is_as_cheap_as_dijkstra(world):
    rng, weights, corner_cutting = world
    problem = PlanningProblem(weights, some_cell(rng, weights), some_cell(rng, weights), corner_cutting)
    assert_as_cheap(plan(Astar(SETTINGS), problem), plan(Dijkstra(SETTINGS), problem))


def test_astar_on_a_large_rough_map_is_as_cheap_as_dijkstra():
    weights = ground("rough", np.random.default_rng(3), 300, 400, 0.2)
    weights[0, 0] = weights[299, 399] = 0.5
    problem = PlanningProblem(weights, Cell(0, 0), Cell(399, 299), True)
    best = plan(Dijkstra(SETTINGS), problem)
    assert best.path is not None
    assert_as_cheap(plan(Astar(SETTINGS), problem), best)


def test_astars_equally_short_ways_have_few_bends():
    result = plan(Astar(SETTINGS), PlanningProblem(np.full((20, 40), 0.5), Cell(0, 5), Cell(30, 12)))
    turns = (np.diff(np.diff(np.array(result.path.cells), axis=0), axis=0) != 0).any(axis=1).sum()
    assert turns == 1


@given(worlds(), st.integers(8, 40), st.integers(0, 6))
@settings(max_examples=examples(300), deadline=None)
def test_the_path_is_a_cheapest_one_however_little_room_the_queue_begins_with(world, room, blocks):
    rng, weights, corner_cutting = world
    for _ in range(blocks):  # even ground with blocks of other ground in it is where most steps are left out
        y, x = rng.integers(0, weights.shape[0]), rng.integers(0, weights.shape[1])
        weights[y : y + rng.integers(1, 8), x : x + rng.integers(1, 8)] = rng.choice([0.3, 0.8, 1.0])
    start, target = some_cell(rng, weights), some_cell(rng, weights)
    weights[start.y, start.x] = weights[target.y, target.x] = 0.5
    best = plan(Dijkstra(SETTINGS), PlanningProblem(weights, start, target, corner_cutting)).path
    cells = shortest(weights, np.zeros(weights.size, np.int64), room, Query(*start, *target, corner_cutting))
    assert (len(cells) == 0) == (best is None)
    if best is not None:
        assert cells_cost(weights, cells) == pytest.approx(best.cost, rel=1e-9)
        assert is_path(weights, as_cells(cells), corner_cutting)
        assert (Cell(*cells[0]), Cell(*cells[-1])) == (start, target)


def test_the_least_cost_whether_the_guess_is_right_or_not():
    fields = np.full(41, 0.5)
    fields[::7] = 1.0
    assert least_cost(fields, 0.5) == 0.5 and least_cost(fields, 0.7) == 0.5
    fields[40] = 0.2
    assert least_cost(fields, 0.5) == 0.2
    fields[3] = 0.0
    assert least_cost(fields, 0.0) == least_cost(fields, 0.5) == MIN_WEIGHT


def drive(planner, seed, steps=12):
    """Problems of a drive whose map changes as it goes, each with the planner's answer to it."""
    rng = np.random.default_rng(seed)
    kind, blocked = ("even", "rough", "cheap", "free")[seed % 4], (0.0, 0.15, 0.35)[seed // 4 % 3]
    weights = ground(kind, rng, *rng.integers(2, 30, 2), blocked)
    start, target = some_cell(rng, weights), some_cell(rng, weights)
    for _ in range(steps):
        problem = PlanningProblem(weights.copy(), start, target, bool(seed & 16))
        result = plan(planner, problem)
        yield problem, result
        if result.path is not None:
            start = result.path.cells[min(int(rng.integers(0, 4)), len(result.path.cells) - 1)]
        if rng.random() < 0.1:
            start = some_cell(rng, weights)
        for _ in range(rng.integers(0, 6)):
            x, y = some_cell(rng, weights)
            weights[y, x] = rng.choice([1.0, 0.5, rng.random()])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(200), deadline=None)
def test_dstar_lite_stays_as_cheap_as_dijkstra_on_a_map_that_changes(seed):
    for problem, result in drive(DstarLite(SETTINGS), seed):
        assert_as_cheap(result, plan(Dijkstra(SETTINGS), problem))
        if result.path is not None:
            assert is_path(problem.weights, result.path.cells, problem.corner_cutting)
            assert result.path.cells[0] == problem.start and result.path.cells[-1] == problem.target


@pytest.mark.parametrize("seed", range(8))
def test_dstar_lite_repeats_for_the_same_sequence(seed):
    first, second = ([result for _, result in drive(DstarLite(SETTINGS), seed)] for _ in range(2))
    assert [r.path and (r.path.cells, r.path.cost) for r in first] == [
        r.path and (r.path.cells, r.path.cost) for r in second
    ]


def test_dstar_lite_repairs_instead_of_searching_anew():
    problem, planner = one_obstacle(4), DstarLite(SETTINGS)
    path = plan(planner, problem).path
    begun = planner._search
    weights = problem.weights.copy()
    x, y = path.cells[-5]  # near the target, where the search began: not even the easiest case
    weights[y, x] = 1.0
    changed = PlanningProblem(weights, path.cells[3], problem.target)
    assert_as_cheap(plan(planner, changed), plan(Dijkstra(SETTINGS), changed))
    assert planner._search.g is begun.g
    plan(planner, PlanningProblem(weights, path.cells[3], Cell(1, 1)))
    assert planner._search.g is not begun.g


def test_theta_star_goes_straight_at_any_angle():
    result = plan(ThetaStar(SETTINGS), PlanningProblem(np.full((20, 40), 0.5), Cell(1, 5), Cell(30, 12)))
    assert result.path.curve.tolist() == [[1.0, 5.0], [30.0, 12.0]]


def test_theta_star_turns_only_at_the_obstacles_corners():
    problem = one_obstacle()
    curve = plan(ThetaStar(SETTINGS), problem).path.curve
    length = np.hypot(*np.diff(curve, axis=0).T).sum()
    # Over the block's upper or lower corners, one field beside it: the shortest line there is.
    over = np.hypot(47, 10) + 6 + np.hypot(45, 10)
    assert length <= 1.01 * over
    assert len(curve) <= 5


def cost_of_line(weights, x0, y0, x1, y1, corner_cutting):
    even = weights[y1, x1]
    return line_cost(Ground(weights, others_before(weights, even), even, corner_cutting), x0, y0, x1, y1)


@given(st.integers(0, 2**32 - 1), st.integers(0, 4), st.booleans())
@settings(max_examples=examples(200), deadline=None)
def test_the_cost_of_a_line_is_that_of_its_fields(seed, blocks, corner_cutting):
    rng = np.random.default_rng(seed)
    weights = ground("even", rng, *rng.integers(2, 90, 2), 0.0)
    for _ in range(blocks):
        y, x = rng.integers(0, weights.shape[0]), rng.integers(0, weights.shape[1])
        weights[y : y + rng.integers(1, 30), x : x + rng.integers(1, 30)] = rng.choice([0.0, 0.2, 0.8, 1.0])
    start, end = some_cell(rng, weights), some_cell(rng, weights)
    if start == end or weights[start.y, start.x] == 1.0:
        return
    cells = polyline(np.array([start, end]))
    expected = np.inf
    if is_path(weights, as_cells(cells), corner_cutting):
        under = np.maximum(weights[cells[1:, 1], cells[1:, 0]], MIN_WEIGHT)
        expected = np.hypot(end.x - start.x, end.y - start.y) * under.mean()
    assert cost_of_line(weights, *start, *end, corner_cutting) == pytest.approx(expected)


@given(world=worlds())
@settings(max_examples=examples(200), deadline=None)
def test_theta_stars_curve_is_free_and_no_longer_than_its_fields(world):
    rng, weights, corner_cutting = world
    problem = PlanningProblem(weights, some_cell(rng, weights), some_cell(rng, weights), corner_cutting)
    result = plan(ThetaStar(SETTINGS), problem)
    if result.path is None:
        assert plan(Dijkstra(SETTINGS), problem).status is PlanStatus.NO_PATH
        return
    corners = result.path.curve.astype(int)
    for (x0, y0), (x1, y1) in pairwise(corners):
        assert np.isfinite(cost_of_line(weights, x0, y0, x1, y1, corner_cutting))


def test_theta_star_follows_preferred_ground():
    weights = drawn("0000000000", "9999999990", "9999999990", "0999999990")
    result = plan(ThetaStar(SETTINGS), PlanningProblem(weights, Cell(0, 0), Cell(9, 0)))
    assert sum(weights[y, x] for x, y in result.path.cells) < 3.0


def test_a_line_past_a_corner_is_free_only_where_corners_may_be_cut():
    weights = drawn(".#", "..")
    assert np.isinf(cost_of_line(weights, 0, 0, 1, 1, False))
    assert cost_of_line(drawn("#.", ".."), 0, 0, 1, 1, True) == pytest.approx(0.5 * np.sqrt(2.0))
