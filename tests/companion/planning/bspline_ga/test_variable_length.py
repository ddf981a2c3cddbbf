"""Chromosomes that choose the number of their control points."""

import numpy as np
import pytest

from companion.core.grid import Cell
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.bspline_ga.variable_length import LEAST, between, breed_any, insert_knot, remove_knot
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.random_numbers import seeded
from companion.settings import PlannerSettings
from sitl.experiments.experiment import START, TARGET, load_maps
from tests.companion.planning.bspline_ga.test_bspline_ga import TUNING
from tests.support.planning_maps import one_obstacle

ADAPTIVE = TUNING._replace(adaptive=True, most_control_points=7, number_probability=1.0)


def plan(problem, budget, seed, **changes):
    return BsplineGa(PlannerSettings(**changes)).plan(problem, budget, np.random.default_rng(seed))


def wide(count, room=1):
    genes = np.zeros((count + room, 2), np.int64)
    genes[:count] = np.random.default_rng(count).integers(0, 10_000, (count, 2))
    return genes


def apart(one, other):
    """Greatest distance from a point of one curve to the other curve."""
    one, other = (bspline.curve(genes.astype(float), 800) for genes in (one, other))
    return float(np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1)).min(axis=1).max())


@pytest.mark.parametrize("count", [3, 4, 5, 8])
def test_a_new_knot_keeps_the_curve_nearly(count):
    for span in range(count - 2):
        genes = wide(count)
        before = genes[:count].copy()
        insert_knot(genes, count, span)
        assert genes[0].tolist() == before[0].tolist() and genes[count].tolist() == before[-1].tolist()
        size = np.ptp(before, axis=0).max()
        # With one span nothing but rounding is left; else making the knots equidistant again moves the curve a little.
        assert apart(genes[: count + 1], before) < (size * 0.13 if count > 3 else 12.0)


@pytest.mark.parametrize("count", [3, 4, 6])
def test_removing_a_knot_undoes_inserting_it(count):
    for span in range(count - 2):
        genes = wide(count)
        before = genes[:count].copy()
        insert_knot(genes, count, span)
        remove_knot(genes, count + 1, span)
        assert np.abs(genes[:count] - before).max() <= 2


def test_the_control_polygon_is_itself_at_its_abscissae():
    genes = wide(6, 0)
    for i, place in enumerate((0.0, 0.125, 0.375, 0.625, 0.875, 1.0)):
        assert [between(genes, 6, place, axis) for axis in (0, 1)] == pytest.approx(genes[i].tolist())


def test_children_keep_the_ends_and_have_a_number_between_the_least_and_the_most():
    parents = np.zeros((3, 7, 2), np.int64)
    counts = np.array([3, 7, 5])
    for genes, count in zip(parents, counts, strict=True):
        genes[:count] = np.linspace((2, 3), (90, 40), count)
    state = seeded(1)
    genes = parents[0].copy()
    seen = set()
    for _ in range(600):
        count = breed_any(genes, parents, counts, 20, ADAPTIVE, state)
        seen.add(count)
        assert genes[0].tolist() == [2, 3] and genes[count - 1].tolist() == [90, 40]
    assert seen <= set(range(LEAST, 8)) and len(seen) >= 4


def test_it_finds_what_its_first_number_cannot():
    weights = np.full((50, 100), 0.5)
    for x, gap in ((33, 10), (66, 40)):
        weights[:, x] = 1.0
        weights[gap - 3 : gap + 4, x] = 0.5
    problem = PlanningProblem(weights, Cell(0, 24), Cell(98, 24))

    def plans(adaptive):
        return [plan(problem, Budget(1, 200, (3,), 30), seed, adaptive=adaptive) for seed in range(30)]

    assert not any(result.path for result in plans(False))
    adapted = [result for result in plans(True) if result.path is not None]
    assert len(adapted) >= 15
    assert all(result.control_points > 3 for result in adapted)


def test_it_begins_again_with_every_number_of_the_budget():
    problem = one_obstacle()
    problem.weights[:, 50] = 1.0
    result = plan(problem, Budget(1, 20, (4, 5, 6), 24), 0, adaptive=True)
    assert result.path is None and result.epochs == 60
    assert plan(one_obstacle(), Budget(), 0, adaptive=True).path is not None


def test_on_rooms_it_succeeds_sooner_than_the_numbers_in_turn():
    problem = PlanningProblem(load_maps(None, ("known-3",))["known-3"].weights, START, TARGET)
    budget = Budget(1, 100, (4, 5, 6, 8, 10), 30)

    def epochs(adaptive):
        plans = [plan(problem, budget, seed, adaptive=adaptive) for seed in range(60)]
        return [result.epochs for result in plans if result.path is not None]

    in_turn, adapted = epochs(False), epochs(True)
    assert len(in_turn) >= 55 and len(adapted) >= 55
    # Measured over 200 seeds: medians 102 and 18.
    assert np.median(adapted) < 0.6 * np.median(in_turn)
