"""A*, Theta* and D* Lite beside Dijkstra, which is held to scipy and networkx in its own tests."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.grid import Cell, as_cells
from companion.planning.astar import Astar
from companion.planning.astar_kernel import BUCKETS, per_bucket, swept
from companion.planning.canonical import is_uniform, shortest_uniform
from companion.planning.dijkstra import Dijkstra
from companion.planning.dstar_lite import DstarLite
from companion.planning.problem import Budget, PlanningProblem, PlanStatus
from companion.planning.raster import cells_cost, is_path
from companion.planning.theta_star import ThetaStar, line_cost
from companion.settings import PlannerSettings
from tests.planning_maps import drawn, one_obstacle

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


def as_cheap(found, best):
    assert found.status == best.status
    if best.path is not None:
        assert found.path.cost == pytest.approx(best.path.cost, rel=1e-10)


@given(world=worlds())
@settings(max_examples=400, deadline=None)
def test_astar_is_as_cheap_as_dijkstra(world):
    rng, weights, corner_cutting = world
    problem = PlanningProblem(weights, some_cell(rng, weights), some_cell(rng, weights), corner_cutting)
    as_cheap(plan(Astar(SETTINGS), problem), plan(Dijkstra(SETTINGS), problem))


def test_astar_on_a_large_rough_map_is_as_cheap_as_dijkstra():
    weights = ground("rough", np.random.default_rng(3), 300, 400, 0.2)
    weights[0, 0] = weights[299, 399] = 0.5
    problem = PlanningProblem(weights, Cell(0, 0), Cell(399, 299), True)
    best = plan(Dijkstra(SETTINGS), problem)
    assert best.path is not None
    as_cheap(plan(Astar(SETTINGS), problem), best)


def test_astars_equally_short_ways_have_few_bends():
    result = plan(Astar(SETTINGS), PlanningProblem(np.full((20, 40), 0.5), Cell(0, 5), Cell(30, 12)))
    turns = (np.diff(np.diff(np.array(result.path.cells), axis=0), axis=0) != 0).any(axis=1).sum()
    assert turns == 1


@given(seed=st.integers(0, 2**32 - 1), room=st.integers(8, 40), share=st.sampled_from([0.0, 0.1, 0.3, 0.4]))
@settings(max_examples=300, deadline=None)
def test_on_uniform_ground_the_path_is_a_shortest_one_however_little_room_the_queue_begins_with(seed, room, share):
    rng = np.random.default_rng(seed)
    weights = ground("even", rng, *rng.integers(1, 40, 2), share)
    for _ in range(rng.integers(0, 6)):
        y, x = rng.integers(0, weights.shape[0]), rng.integers(0, weights.shape[1])
        weights[y : y + rng.integers(1, 8), x : x + rng.integers(1, 8)] = 1.0
    start, target = some_cell(rng, weights), some_cell(rng, weights)
    weights[start.y, start.x] = weights[target.y, target.x] = 0.5
    best = plan(Dijkstra(SETTINGS), PlanningProblem(weights, start, target)).path
    cells = shortest_uniform(weights, np.zeros(weights.size, np.int64), room, *start, *target)
    assert (len(cells) == 0) == (best is None)
    if best is not None:
        assert cells_cost(weights, cells) == pytest.approx(best.cost, rel=1e-9)
        assert is_path(weights, as_cells(cells)) and (Cell(*cells[0]), Cell(*cells[-1])) == (start, target)


def test_uniform_ground():
    weights = np.full(40, 0.3)
    weights[::7] = 1.0
    assert is_uniform(weights, 0.3) and not is_uniform(weights, 0.5)
    weights[39] = 0.2
    assert not is_uniform(weights, 0.3)


def test_sweeping_keeps_what_still_waits():
    """Three fields of a row: one waits, one was taken, one waits in a cheaper bucket than this entry's."""
    least, width, target = 0.5, 3, (2, 0)
    reached = np.array([5.0, -5.0, 5.0])
    slots = [int((5.0 + least * (2 - x)) * per_bucket(least)) % BUCKETS for x in range(3)]
    heads, entries = np.full(BUCKETS, -1, np.int32), np.zeros((3, 3), np.int32)
    for x, slot in enumerate([slots[0], slots[1], (slots[2] + 40) % BUCKETS]):
        entries[x], heads[slot] = (x, 0, heads[slot]), x
    free, waiting = swept(entries, heads, reached, width, *target, least)
    assert waiting == 1 and heads[slots[0]] == 0 and (heads >= 0).sum() == 1
    assert {free, entries[free, 2]} == {1, 2} and entries[entries[free, 2], 2] == -1


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
@settings(max_examples=200, deadline=None)
def test_dstar_lite_stays_as_cheap_as_dijkstra_on_a_map_that_changes(seed):
    for problem, result in drive(DstarLite(SETTINGS), seed):
        as_cheap(result, plan(Dijkstra(SETTINGS), problem))
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
    begun = planner._memory
    weights = problem.weights.copy()
    x, y = path.cells[-5]  # near the target, where the search began: not even the easiest case
    weights[y, x] = 1.0
    changed = PlanningProblem(weights, path.cells[3], problem.target)
    as_cheap(plan(planner, changed), plan(Dijkstra(SETTINGS), changed))
    assert planner._memory.g is begun.g
    plan(planner, PlanningProblem(weights, path.cells[3], Cell(1, 1)))
    assert planner._memory.g is not begun.g


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


@given(world=worlds())
@settings(max_examples=200, deadline=None)
def test_theta_stars_curve_is_free_and_no_longer_than_its_fields(world):
    rng, weights, corner_cutting = world
    problem = PlanningProblem(weights, some_cell(rng, weights), some_cell(rng, weights), corner_cutting)
    result = plan(ThetaStar(SETTINGS), problem)
    if result.path is None:
        assert plan(Dijkstra(SETTINGS), problem).status is PlanStatus.NO_PATH
        return
    corners = result.path.curve.astype(int)
    for (x0, y0), (x1, y1) in pairwise(corners):
        assert np.isfinite(line_cost(weights, x0, y0, x1, y1, corner_cutting))


def test_theta_star_follows_preferred_ground():
    weights = drawn("0000000000", "9999999990", "9999999990", "0999999990")
    result = plan(ThetaStar(SETTINGS), PlanningProblem(weights, Cell(0, 0), Cell(9, 0)))
    assert sum(weights[y, x] for x, y in result.path.cells) < 3.0


def test_a_line_past_a_corner_is_free_only_where_corners_may_be_cut():
    weights = drawn(".#", "..")
    assert np.isinf(line_cost(weights, 0, 0, 1, 1, False))
    assert line_cost(drawn("#.", ".."), 0, 0, 1, 1, True) == pytest.approx(0.5 * np.sqrt(2.0))
