from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Cell
from companion.planning.bspline_ga import bspline
from companion.planning.bspline_ga.fitness import (
    fitness,
    is_correct,
    large_value,
    way_point,
    way_points_for,
)
from companion.planning.bspline_ga.operators import breed, scatter
from companion.planning.bspline_ga.parameters import Lifetime, Task, Tuning, tuning_of
from companion.planning.bspline_ga.planner import BsplineGa
from companion.planning.bspline_ga.population import Evolution, evolve, measured
from companion.planning.problem import Budget, PlanningProblem, PlanStatus
from companion.planning.random_numbers import seeded
from companion.planning.raster import first_fault, polyline
from companion.settings import PlannerSettings
from tests.support.planning_maps import drawn, one_obstacle
from tests.support.quick import examples

VLN = 100_000.0
TUNING = Tuning(*tuning_of(PlannerSettings(span_way_points=0, obstacle_value=VLN)))
TABLE_1 = {"GA 1": Budget(1, 500, (4,), 40), "GA 2": Budget(1, 500, (4,), 100), "GA 3": Budget(1, 500, (5,), 100)}


def ga(**changes):
    return BsplineGa(PlannerSettings(**changes))


def value_of(weights, genes, corner_cutting=True, way_points=5, limit=np.inf):
    basis = bspline.basis(len(genes), way_points)
    return fitness(weights, genes, basis, Task(0, 0, 0, 0, corner_cutting), VLN, limit)


def test_by_length_the_straighter_of_two_ways_over_as_many_fields_is_fitter():
    """Both lead over 40 fields of open ground; fields alone cannot tell them apart."""
    weights = np.full((30, 41), 0.5)
    basis = bspline.basis(4, 5)
    straight = np.array([[0, 10], [13, 10], [27, 10], [40, 10]])
    bent = np.array([[0, 10], [13, 16], [27, 16], [40, 10]])
    counted, by_length = (
        [
            fitness(weights, genes, basis, Task(0, 0, 0, 0, False, by_length=flag), VLN, np.inf)
            for genes in (straight, bent)
        ]
        for flag in (False, True)
    )
    assert counted[0] == counted[1] == by_length[0] == pytest.approx(19.5)
    places = [way_point(bent, basis, i) for i in range(5)]
    length = sum(np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(places))
    assert by_length[1] == pytest.approx(0.5 * length - 0.5)


def walk_of(genes, way_points=5):
    basis = bspline.basis(len(genes), way_points)
    return polyline(np.array([way_point(genes, basis, i) for i in range(way_points)]))


def cluttered(seed, share=0.1):
    rng = np.random.default_rng(seed)
    weights = rng.random((30, 40))
    weights[rng.random((30, 40)) < share] = 1.0
    weights[15, 0] = weights[15, 39] = 0.5
    return weights


genes_strategy = st.lists(st.tuples(st.integers(-10, 50), st.integers(-10, 40)), min_size=1, max_size=4).map(
    lambda inner: np.array([(0, 15), *inner, (39, 15)])
)


@settings(deadline=None)  # the first call compiles
@given(genes_strategy, st.integers(0, 20))
def test_fitness_is_the_sum_of_the_fields_with_ends_free_and_obstacles_vln(genes, seed):
    weights = cluttered(seed)
    expected = 0.0
    for x, y in walk_of(genes)[1:-1]:
        inside = 0 <= x < 40 and 0 <= y < 30
        expected += weights[y, x] if inside and weights[y, x] < 1.0 else VLN
    assert value_of(weights, genes) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@settings(deadline=None)  # the first call compiles
@given(genes_strategy, st.integers(0, 20), st.floats(0.1, 40.0))
def test_stopping_at_a_limit_hides_nothing_below_it(genes, seed, limit):
    weights = cluttered(seed, 0.01)
    whole = value_of(weights, genes, False)
    stopped = value_of(weights, genes, False, limit=limit)
    assert stopped == whole if whole < limit else stopped >= limit


@settings(deadline=None, max_examples=examples(300))
@given(genes_strategy, st.integers(0, 20), st.sampled_from([0.02, 0.3]), st.booleans())
def test_fitness_is_below_vln_exactly_for_correct_paths(genes, seed, share, corner_cutting):
    weights = cluttered(seed, share)
    walk = walk_of(genes)
    walk = walk[np.append(True, (np.diff(walk, axis=0) != 0).any(axis=1))]
    correct = first_fault(weights, walk, corner_cutting)[0] == 0
    assert is_correct(value_of(weights, genes, corner_cutting), VLN) == correct


def test_a_corner_cut_by_the_last_step_makes_a_path_incorrect():
    weights = drawn("...", "#..", "...")
    genes = np.array([(1, 1), (1, 1), (1, 1), (0, 0)])
    assert [tuple(cell) for cell in walk_of(genes)] == [(1, 1), (0, 0)]
    assert value_of(weights, genes, False) == pytest.approx(VLN)
    assert value_of(weights, genes, True) == 0.0


def test_a_cut_corner_counts_as_an_obstacle_unless_allowed():
    weights = drawn("....", ".#..", "....")
    genes = np.array([(0, 0), (1, 0), (1, 0), (2, 1)])
    assert [tuple(cell) for cell in walk_of(genes)] == [(0, 0), (1, 0), (2, 1)]
    assert value_of(weights, genes, True) == pytest.approx(0.5)
    assert value_of(weights, genes, False) == pytest.approx(VLN + 0.5)


def test_vln_is_above_any_correct_path_of_a_large_map():
    assert large_value(4, 100, 50, TUNING) == VLN
    assert large_value(4, 400_000, 50, TUNING) >= 4 * 400_000


def test_way_points_are_the_papers_five_and_grow_with_the_control_points():
    assert [way_points_for(count, TUNING) for count in (3, 4, 5, 8)] == [5, 5, 5, 5]
    growing = TUNING._replace(span_way_points=2)
    assert [way_points_for(count, growing) for count in (3, 4, 5, 8)] == [5, 5, 7, 13]


def scattered(part, count=300, tuning=TUNING, control_points=4):
    state = seeded(7)
    result = np.empty((count, control_points, 2), np.int64)
    for genes in result:
        genes[0], genes[-1] = (3, 24), (93, 24)
        scatter(genes, part, 100, 50, tuning, state)
    assert (result[:, 0] == (3, 24)).all() and (result[:, -1] == (93, 24)).all()
    return result[:, 1:-1]


def test_first_third_is_the_straight_line_with_some_points_shifted():
    inner = scattered(0)
    shift = inner - np.array([(33, 24), (63, 24)])
    assert np.abs(shift).max() == 10
    assert 0.4 < (shift != 0).mean() < 0.55
    assert (scattered(0, tuning=TUNING._replace(line_probability=0.0)) == [(33, 24), (63, 24)]).all()


def test_second_third_is_near_the_start_and_inside_the_map():
    inner = scattered(1)
    assert inner[..., 0].min() == 0 and inner[..., 0].max() == 13
    assert inner[..., 1].min() == 14 and inner[..., 1].max() == 34


def test_last_third_is_anywhere_but_the_margin():
    inner = scattered(2, 2000, TUNING._replace(margin_fields=3))
    assert inner[..., 0].min() == 3 and inner[..., 0].max() == 96
    assert inner[..., 1].min() == 3 and inner[..., 1].max() == 46


def test_crossing_gives_the_better_parent_the_larger_share():
    parents = np.array([[(0, 0), (10, 20), (9, 9)], [(0, 0), (20, 40), (9, 9)]])
    genes = parents[0].copy()
    for seed in range(20):
        breed(genes, parents, 0, TUNING, seeded(seed))
        assert genes.tolist() == [[0, 0], [12, 24], [9, 9]]


def test_mutation_hits_four_genes_of_ten_within_half_the_smaller_side_and_never_the_ends():
    parents = np.zeros((2, 5, 2), np.int64)
    parents[:, -1] = 99
    genes = parents[0].copy()
    state = seeded(3)
    changes = []
    for _ in range(2000):
        breed(genes, parents, 25, TUNING, state)
        assert genes[0].tolist() == [0, 0] and genes[-1].tolist() == [99, 99]
        changes.append(genes[1:-1].ravel().copy())
    changed = np.array(changes)
    assert changed.min() == -25 and changed.max() == 25
    # 12000 draws: four standard deviations are 0.018; a change of 0 (1 of 51) is not seen as one.
    assert (changed != 0).mean() == pytest.approx(0.4 * 50 / 51, abs=0.018)


def plainly_evolved(weights, task, tuning, lifetime, control_points, state):
    """Section 3 without any shortcut: whole populations, whole sums, a stable sort."""
    population, min_epochs, max_epochs = lifetime
    height, width = weights.shape
    basis = bspline.basis(control_points, way_points_for(control_points, tuning))

    def measured(genes):
        return fitness(weights, genes, basis, task, VLN, np.inf)

    people = []
    for i in range(population):
        genes = np.empty((control_points, 2), np.int64)
        genes[0], genes[-1] = (task.start_x, task.start_y), (task.target_x, task.target_y)
        scatter(genes, i * 3 // population, width, height, tuning, state)
        people.append((measured(genes), genes))
    epoch = 1
    while True:
        people.sort(key=lambda one: one[0])
        if epoch >= max_epochs or (epoch >= min_epochs and people[0][0] < VLN):
            return people[0][0], people[0][1], epoch
        people = people[: int(population * tuning.selected_share)]
        parents = np.array([genes for _, genes in people])
        for _ in range(population - len(parents)):
            genes = parents[0].copy()
            breed(genes, parents, min(width, height) // 2, tuning, state)
            people.append((measured(genes), genes))
        epoch += 1


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([3, 4, 6]), st.sampled_from([12, 30]), st.booleans())
def test_keeping_only_the_selected_and_stopping_sums_early_changes_nothing(seed, control_points, population, cutting):
    weights = cluttered(seed, 0.25)
    task = Task(0, 15, 39, 15, cutting)
    arguments = (weights, task, TUNING, Lifetime(population, 4, 12), control_points)
    value, genes, epochs, evaluations = evolve(*arguments, seeded(seed))
    expected_value, expected_genes, expected_epochs = plainly_evolved(*arguments, seeded(seed))
    assert value == pytest.approx(expected_value, rel=1e-12)
    assert genes.tolist() == expected_genes.tolist()
    assert epochs == expected_epochs
    assert evaluations == population + (epochs - 1) * (population - population // 4)


def test_epochs_are_at_least_the_minimum_and_at_most_the_maximum():
    easy = one_obstacle()
    result = ga().plan(easy, Budget(17, 500), np.random.default_rng(0))
    assert result.status is PlanStatus.FOUND and result.epochs == 17 and result.control_points == 4
    weights = easy.weights.copy()
    weights[:, 50] = 1.0
    hopeless = PlanningProblem(weights, easy.start, easy.target)
    result = ga().plan(hopeless, Budget(1, 20, (4, 5, 6)), np.random.default_rng(0))
    assert result.status is PlanStatus.BUDGET_SPENT and result.epochs == 60
    assert result.evaluations == 3 * (30 + 19 * 23)


@pytest.mark.parametrize("budget", TABLE_1.values(), ids=TABLE_1.keys())
def test_one_obstacle_is_passed_from_nearly_every_seed(budget):
    problem = one_obstacle()
    found = sum(ga().plan(problem, budget, np.random.default_rng(seed)).path is not None for seed in range(100))
    assert found >= 99


def test_more_epochs_find_the_preferred_ground():
    weights = np.full((50, 100), 0.5)
    weights[34:42] = 0.05
    problem = PlanningProblem(weights, Cell(0, 24), Cell(98, 24))

    def mean_sum(min_epochs):
        plans = [ga().plan(problem, Budget(min_epochs, 500), np.random.default_rng(seed)) for seed in range(60)]
        return np.mean([sum(weights[y, x] for x, y in plan.path.cells[1:-1]) for plan in plans])

    assert mean_sum(40) < 0.8 * mean_sum(1)


def test_paths_keep_off_soft_cost_where_there_is_room():
    """A block with dearer fields round it: with room they are left alone, in a tunnel of them they are crossed."""
    problem = one_obstacle()
    weights = problem.weights
    soft = np.zeros(weights.shape, bool)
    soft[11:40, 44:57] = True
    weights[soft & (weights < 1.0)] = 0.95

    def soft_share(min_epochs):
        plans = [ga().plan(problem, Budget(min_epochs, 500), np.random.default_rng(seed)) for seed in range(60)]
        return np.mean([sum(soft[y, x] for x, y in plan.path.cells) for plan in plans])

    # Straight past the block there are 13 soft fields.
    assert soft_share(40) < 3.0 < soft_share(1)
    weights[:11, 40:60] = weights[40:, 40:60] = 0.95
    assert soft_share(40) >= 10.0


@settings(deadline=None, max_examples=examples(60))
@given(st.integers(0, 10_000), st.sampled_from([0.5, 1.5, 3.5]))
def test_a_glance_at_a_large_map_rejects_only_what_the_whole_sum_would(seed, obstacles):
    rng = np.random.default_rng(seed)
    weights = np.full((600, 1200), 0.5)
    for x in range(200, 1100, 300):
        weights[rng.integers(0, 400) :, x : x + 60] = 1.0
    genes = np.array([(3, 300), *rng.integers((0, 0), (1200, 600), (2, 2)), (1190, 300)])
    weights[300, [3, 1190]] = 0.5
    basis = bspline.basis(4, 5)
    limit = obstacles * VLN
    task = Task(3, 300, 1190, 300, False)
    whole = fitness(weights, genes, basis, task, VLN, np.inf)
    value = measured(Evolution(weights, task, TUNING, Lifetime(30, 1, 500), VLN), genes, basis, limit)
    assert value == whole if whole < limit else value >= limit


def test_more_control_points_solve_what_fewer_cannot():
    weights = np.full((50, 100), 0.5)
    for x, gap in ((25, 12), (50, 36), (75, 12)):
        weights[:, x] = 1.0
        weights[gap - 4 : gap + 5, x] = 0.5
    problem = PlanningProblem(weights, Cell(0, 24), Cell(98, 24))

    def found(count):
        budget = Budget(1, 200, (count,), 60)
        return sum(ga().plan(problem, budget, np.random.default_rng(seed)).path is not None for seed in range(20))

    # With 4 control points the curve has too few bends for three gaps.
    assert found(4) == 0
    assert found(8) >= 14


def test_another_seed_may_give_another_path():
    problem = one_obstacle()
    paths = {ga().plan(problem, Budget(), np.random.default_rng(seed)).path.cells for seed in range(10)}
    assert len(paths) > 1


def test_the_curve_is_near_the_fields_it_made():
    result = ga().plan(one_obstacle(), Budget(), np.random.default_rng(4))
    curve, cells = result.path.curve, np.array(result.path.cells)
    assert len(curve) == 2 * len(cells) + 1
    gaps = np.hypot(*(curve[:, None] - cells[None]).transpose(2, 0, 1))
    assert gaps.min(axis=1).max() < 8.0  # five way points: a bulge, but no other way
    assert gaps.min(axis=0).max() < 8.0


def test_a_budget_without_sense_is_refused():
    problem = one_obstacle()
    for budget in (Budget(control_points=()), Budget(control_points=(4, 2)), Budget(population=3)):
        with pytest.raises(ValueError):
            ga().plan(problem, budget, np.random.default_rng(0))
