"""Staircases made smooth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Cell
from companion.planning.graph_search.theta_star import any_angle
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.raster import FAULTS, PathFault, cells_cost, first_fault, polyline
from companion.planning.registry import make_planner
from companion.planning.smoothing import curve_cost, smooth, straightened, taut
from companion.settings import PlannerSettings
from tests.support.planning_maps import drawn, one_obstacle
from tests.support.quick import examples


def shortest(problem: PlanningProblem):
    path = make_planner("dijkstra", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
    return None if path is None else path.cell_array


def fields_under(curve):
    return polyline(np.floor(curve + 0.5).astype(np.int64))


def sharpest_bend_deg(curve):
    steps = np.diff(curve, axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-9]
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.degrees(np.abs(np.diff(headings)).max())) if len(headings) > 1 else 0.0


@st.composite
def grounds(draw):
    width, height = draw(st.integers(2, 24)), draw(st.integers(2, 24))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    weights = rng.random((height, width)) if draw(st.booleans()) else np.full((height, width), 0.5)
    weights[rng.random((height, width)) < draw(st.sampled_from([0.0, 0.15, 0.3]))] = 1.0
    weights[0, 0] = weights[-1, -1] = 0.5
    return PlanningProblem(weights, Cell(0, 0), Cell(width - 1, height - 1))


@given(grounds())
@settings(max_examples=examples(200), deadline=None)
def test_the_curve_is_a_path_between_the_same_ends_and_hardly_dearer(problem):
    cells = shortest(problem)
    if cells is None:
        return
    curve = smooth(problem.weights, cells)
    assert tuple(curve[0]) == problem.start and tuple(curve[-1]) == problem.target
    under = fields_under(curve)
    number, at = first_fault(problem.weights, under, False)
    assert FAULTS[number] is PathFault.NONE, f"{FAULTS[number]} at {at}"


@given(grounds())
@settings(max_examples=examples(200), deadline=None)
def test_pulled_straight_it_keeps_to_fields_of_the_path_and_costs_no_more(problem):
    cells = shortest(problem)
    if cells is None:
        return
    corners = straightened(problem.weights, cells)
    on_path = {tuple(cell) for cell in cells.tolist()}
    assert all(tuple(corner) in on_path for corner in corners.tolist())
    assert cells_cost(problem.weights, polyline(corners)) <= 1.02 * cells_cost(problem.weights, cells) + 1e-6


def test_a_staircase_over_open_ground_becomes_one_line():
    weights = np.full((30, 60), 0.5)
    curve = smooth(weights, shortest(PlanningProblem(weights, Cell(0, 3), Cell(59, 20))))
    assert len(curve) == 2


def test_bends_are_rounded_where_there_is_room():
    problem = one_obstacle()
    weights = problem.weights.copy()
    weights[12:39, 45:56] = np.where(
        weights[12:39, 45:56] < 1.0, 0.9, 1.0
    )  # dear ground keeps the path away from the block
    cells = shortest(PlanningProblem(weights, problem.start, problem.target))
    assert sharpest_bend_deg(cells.astype(float)) == pytest.approx(45.0)
    assert sharpest_bend_deg(smooth(weights, cells)) < 15.0


def test_without_room_a_corner_stays():
    weights = drawn("#####.", "#####.", "#####.", "......")
    curve = smooth(weights, shortest(PlanningProblem(weights, Cell(0, 0), Cell(5, 3))))
    assert [5, 0] in fields_under(curve).tolist()
    assert sharpest_bend_deg(curve) < 45.0


@given(grounds())
@settings(max_examples=examples(200), deadline=None)
def test_taut_corners_see_each_other(problem):
    cells = shortest(problem)
    if cells is None:
        return
    corners = straightened(problem.weights, cells)
    shorter = taut(problem.weights, corners)
    assert (shorter[0] == corners[0]).all() and (shorter[-1] == corners[-1]).all()
    assert first_fault(problem.weights, polyline(shorter), False)[0] == 0
    before, after = (curve_cost(problem.weights, line.astype(float)) for line in (corners, shorter))
    assert after <= 1.15 * before + 1e-9


def test_taut_is_nearly_as_short_as_any_angle_search_on_the_whole_map():
    """A corridor is enough: in random clutter the mean is within 3 % of a search of the whole map."""
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        weights = np.full((50, 100), 0.5)
        for _ in range(25):
            x, y = rng.integers(3, 92), rng.integers(0, 44)
            weights[y : y + rng.integers(2, 7), x : x + rng.integers(2, 7)] = 1.0
        weights[24, 0] = weights[24, 98] = 0.5
        problem = PlanningProblem(weights, Cell(0, 24), Cell(98, 24))
        cells = shortest(problem)
        if cells is not None:
            whole = any_angle(weights, problem.start, problem.target, False)
            beside = taut(weights, straightened(weights, cells))
            ratios.append(length_of(beside) / length_of(whole))
    assert len(ratios) >= 15
    assert np.mean(ratios) < 1.03


def length_of(corners):
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())


def test_what_driving_along_a_curve_costs():
    weights = drawn("..#..", ".....", ".....")
    assert curve_cost(weights, np.array([[0.0, 0.0], [4.0, 0.0]])) == pytest.approx(2.0)
    assert curve_cost(weights, np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])) == pytest.approx(np.sqrt(2.0))
    assert curve_cost(weights, np.array([[0.0, 2.0], [4.0, 2.0]])) == pytest.approx(3 * 0.5 + 10.0)
    assert curve_cost(weights, np.array([[1.0, 1.0]])) == 0.0


@pytest.mark.parametrize("by", [(0.0, 3.0), (0.0, -3.0), (6.0, 0.0), (-6.0, 0.0)])
def test_off_the_map_a_curve_costs_what_an_obstacle_does(by: tuple[float, float]) -> None:
    """A genetic curve may bulge over the edge between its way points. What lies in memory there must not count."""
    memory = np.full((11, 15), 0.123)
    weights = memory[4:7, 5:10]
    weights[:] = 0.5
    inside, outside = np.array([[2.0, 1.0], [2.0, 1.0]]), np.array([[2.0, 1.0], [2.0, 1.0]])
    outside[1] += by
    inside[1] += np.clip(by, -1.4, 1.4)
    length, within = float(np.abs(by).sum()), 0.5 * (1.5 if by[0] == 0.0 else 2.5)
    assert curve_cost(weights, outside) == pytest.approx(within + 10.0 * (length - within / 0.5))
    assert curve_cost(weights, inside) == pytest.approx(0.5 * 1.4)


def test_taut_keeps_a_field_of_room_at_corners_where_there_is_room():
    """Round the end of a wall: the field at its corner is left alone, but not where the gap is one field wide."""
    weights = np.full((30, 40), 0.5)
    weights[8:, 20] = 1.0
    corners = np.array([[10, 20], [19, 7], [21, 7], [30, 20]])
    places = polyline(taut(weights, corners)).tolist()
    assert [19, 7] not in places and [21, 7] not in places
    weights[:7, 20] = 1.0
    assert [20, 7] in polyline(taut(weights, corners)).tolist()
