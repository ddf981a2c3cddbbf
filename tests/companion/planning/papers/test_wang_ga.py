"""The planners ``vertex`` and ``vertex++``: short paths, operators as described, no contact with moving obstacles."""

import numpy as np
import pytest

from companion.core.grid import BASE_WEIGHT, Cell
from companion.planning.papers.wang_ga import planned
from companion.planning.papers.wang_kernel import ranking, room_for, settle
from companion.planning.papers.wang_operators import crossed, mutated, put, speed_mutated
from companion.planning.problem import Budget, KinematicConstraints, ObstacleTrajectory, PlanningProblem, PlanStatus
from companion.planning.random_numbers import seeded
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from companion.settings.planners import VertexSettings
from tests.support.planning_maps import one_obstacle

SETTINGS = VertexSettings()


def plan(problem, seed=0, name="vertex++", settings=SETTINGS):
    return make_planner(name, PlannerSettings(vertex=settings)).plan(problem, Budget(), np.random.default_rng(seed))


def length(path):
    return float(np.hypot(*np.diff(path.curve, axis=0).T).sum())


def duration_s(path):
    return float((np.hypot(*np.diff(path.curve, axis=0).T) / path.speeds_fields_s).sum())


def least_gap(path, movers, begin_s=0.0, until_s=np.inf):
    """Distance between centres less the radius, simulated in steps of 20 ms."""
    reached_s = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path.curve, axis=0).T) / path.speeds_fields_s)))
    times_s = np.arange(0.0, min(reached_s[-1], until_s), 0.02)
    x, y = (np.interp(times_s, reached_s, path.curve[:, axis]) for axis in (0, 1))
    return min(
        (
            np.hypot(
                x - np.interp(times_s + begin_s, *mover.track[:, :2].T),
                y - np.interp(times_s + begin_s, *mover.track[:, ::2].T),
            )
            - mover.radius_fields
        ).min()
        for mover in movers
    )


def crowded(seed):
    """Blocks at random, and moving obstacles that go about between start and target."""
    rng = np.random.default_rng(seed)
    weights = np.full((50, 100), BASE_WEIGHT)
    for _ in range(8):
        x, y = rng.integers(8, 85), rng.integers(0, 45)
        weights[y : y + rng.integers(2, 10), x : x + rng.integers(2, 10)] = 1.0
    return PlanningProblem(weights, Cell(0, 24), Cell(98, 24), moving_obstacles=tuple(_wanderer(rng) for _ in range(5)))


def _wanderer(rng):
    places = rng.uniform((10, 0), (90, 49), (int(rng.integers(2, 6)), 2))
    steps_s = np.hypot(*np.diff(places, axis=0).T) / rng.uniform(0.2, 3.0, len(places) - 1)
    return ObstacleTrajectory(
        float(rng.uniform(0.5, 3.0)), np.column_stack((np.concatenate(([0.0], np.cumsum(steps_s))), places))
    )


def test_no_contact_with_moving_obstacles():
    """200 worlds: nearly always a path, and every path keeps the safe distance at every moment."""
    gaps = []
    for seed in range(200):
        problem = crowded(seed)
        path = plan(problem, seed).path
        if path is not None:
            gaps.append(least_gap(path, problem.moving_obstacles))
    assert len(gaps) >= 196
    assert min(gaps) >= SETTINGS.mover_safe_fields - 1e-6


def test_the_obstacles_are_in_the_way():
    """The same worlds planned without moving obstacles: contact in many of them, so the test above is not trivial."""
    contacts = 0
    for seed in range(60):
        problem = crowded(seed)
        path = plan(PlanningProblem(problem.weights, problem.start, problem.target), seed).path
        contacts += path is not None and least_gap(path, problem.moving_obstacles) < 0.0
    assert contacts >= 15


def test_a_new_plan_when_the_motion_changes():
    """The obstacles get new tracks on the way: a new plan from the rover's field keeps clear of them."""
    found = 0
    for seed in range(60):
        problem = crowded(seed)
        path = plan(problem, seed).path
        if path is None:
            continue
        here = path.cells[len(path.cells) // 4]
        rng = np.random.default_rng(1000 + seed)
        movers = tuple(_wanderer(rng) for _ in range(5))
        movers = tuple(
            m for m in movers if np.hypot(m.track[0, 1] - here.x, m.track[0, 2] - here.y) > m.radius_fields + 5.0
        )
        if not movers:
            continue
        again = plan(PlanningProblem(problem.weights, here, problem.target, moving_obstacles=movers), seed).path
        if again is not None:
            found += 1
            assert again.cells[0] == here
            assert least_gap(again, movers) >= SETTINGS.mover_safe_fields - 1e-6
    assert found >= 55


def test_one_obstacle_is_passed_on_the_shortest_way():
    """Past the corners at the lower side of the block, which is one field nearer: for every seed."""
    problem = one_obstacle()
    shortest = np.hypot(47, 10) + 6 + np.hypot(45, 10)
    for seed in range(30):
        path = plan(problem, seed, "vertex").path
        assert path is not None and path.speeds_fields_s is None
        assert length(path) == pytest.approx(shortest)


def test_the_fastest_way_is_driven_at_the_highest_speed():
    path = plan(one_obstacle()).path
    assert path is not None and path.speeds_fields_s is not None
    assert path.speeds_fields_s == pytest.approx(KinematicConstraints().speeds_fields_s[1])
    assert len(path.speeds_fields_s) == len(path.curve) - 1


def test_one_speed_alone_is_the_highest():
    problem, one = crowded(3), SETTINGS.model_copy(update={"speed_levels": 1})
    for seed in range(5):
        path = plan(problem, seed, settings=one).path
        assert path is not None
        assert path.speeds_fields_s == pytest.approx(problem.kinematics.speeds_fields_s[1])


def test_it_slows_down_for_an_obstacle_that_crosses():
    """In a corridor without room to go round, the only way to let something pass is to be slower."""
    weights = np.full((21, 60), 1.0)
    weights[10, :] = BASE_WEIGHT
    weights[:, 30] = BASE_WEIGHT
    crossing = ObstacleTrajectory(1.0, np.array([(0.0, 30.0, 30.0), (60.0, 30.0, -30.0)]))
    problem = PlanningProblem(
        weights,
        Cell(0, 10),
        Cell(59, 10),
        moving_obstacles=(crossing,),
        kinematics=KinematicConstraints(speeds_fields_s=(0.5, 1.5)),
    )
    for seed in range(20):
        path = plan(problem, seed).path
        assert path is not None
        assert least_gap(path, (crossing,)) >= SETTINGS.mover_safe_fields - 1e-6
        assert duration_s(path) > 59.0 / 1.5 + 1.0


def test_weights_of_the_criteria():
    """Least time takes the highest speed and least length never a longer way than least time."""
    problem = crowded(3)
    by_time = [plan(problem, seed, settings=VertexSettings()).path for seed in range(10)]
    by_length = [
        plan(problem, seed, settings=VertexSettings(length_weight=1.0, time_weight=0.0)).path for seed in range(10)
    ]
    assert np.median([length(p) for p in by_length]) <= np.median([length(p) for p in by_time]) + 1e-9
    assert np.median([duration_s(p) for p in by_time]) <= np.median([duration_s(p) for p in by_length]) + 1e-9


def test_a_mover_that_is_upon_the_rover_already_leaves_no_path():
    problem = PlanningProblem(
        np.full((20, 20), BASE_WEIGHT),
        Cell(2, 2),
        Cell(17, 17),
        moving_obstacles=(ObstacleTrajectory(3.0, np.array([(0.0, 3.0, 2.0)])),),
    )
    assert plan(problem).status is PlanStatus.BUDGET_SPENT
    assert plan(problem, name="vertex").status is PlanStatus.FOUND


def test_the_static_planner_takes_no_notice_of_what_moves():
    problem = crowded(5)
    still = PlanningProblem(problem.weights, problem.start, problem.target)
    a, b = plan(problem, 7, "vertex").path, plan(still, 7, "vertex").path
    assert a is not None and b is not None and a.cells == b.cells


def test_the_safe_distance_yields_where_an_end_is_nearer():
    weights = np.full((20, 40), BASE_WEIGHT)
    weights[8:12, 18:22] = 1.0
    wide = VertexSettings(safe_fields=3.0)
    assert plan(PlanningProblem(weights, Cell(17, 10), Cell(39, 10)), settings=wide).path is not None
    path = plan(PlanningProblem(weights, Cell(0, 10), Cell(39, 10)), settings=wide).path
    blocked = np.argwhere(weights >= 1.0)[:, ::-1]
    gaps = [np.hypot(*np.maximum(np.abs(blocked - cell) - 0.5, 0.0).T).min() for cell in np.array(path.cells)]
    assert min(gaps) >= 3.0


def test_stopping_at_the_first_feasible_path():
    problem = crowded(1)
    whole, first = (planned(problem, SETTINGS, 5, timed=True, first_only=only) for only in (False, True))
    assert 0 <= first.first_feasible == whole.first_feasible == first.generations
    assert whole.value <= first.value


def test_an_unsolvable_problem_ends_with_its_populations():
    weights = np.full((12, 12), BASE_WEIGHT)
    weights[:, 6] = 1.0
    settings = VertexSettings(generations=50, populations=3)
    result = plan(PlanningProblem(weights, Cell(1, 1), Cell(10, 10)), settings=settings)
    assert result.status is PlanStatus.BUDGET_SPENT and result.epochs == 150


def crowd_of(*chromosomes):
    crowd = room_for(len(chromosomes), 10, 100)
    for row, fields in enumerate(chromosomes):
        crowd.fields[row, : len(fields)] = fields
        crowd.speeds[row, : len(fields)] = row
        crowd.lengths[row] = len(fields)
    return crowd


def genes(crowd, place):
    row = crowd.order[len(crowd.order) - 2 + place]
    return crowd.fields[row, : crowd.lengths[row]].tolist()


def test_repeated_vertices_of_lower_locus_are_removed():
    crowd = crowd_of([0, 99], [0, 99])
    crowd.room[0, :7] = (0, 5, 7, 5, 8, 7, 99)
    crowd.room[1, :7] = range(7)
    assert put(crowd, 2, 7)
    assert crowd.fields[2, : crowd.lengths[2]].tolist() == [0, 5, 8, 7, 99]
    assert crowd.speeds[2, : crowd.lengths[2]].tolist() == [0, 3, 4, 5, 6]


def test_crossover_joins_a_head_and_a_tail():
    a, b = [0, 1, 2, 3, 99], [0, 11, 12, 99]
    heads = {(*a[:i], *b[j:]) for i in range(1, 5) for j in range(1, 4)}
    seen = set()
    for seed in range(200):
        crowd = crowd_of(a, b)
        assert crossed(crowd, 0, 1, seeded(seed)) == 2
        seen.add(tuple(genes(crowd, 0)))
    assert seen == heads


def test_mutation_changes_one_vertex_and_never_to_one_that_is_there():
    pool = np.arange(1, 6)
    for seed in range(200):
        crowd = crowd_of([0, 1, 2, 3, 99], [0, 99])
        if mutated(crowd, 0, pool, seeded(seed)):
            child = genes(crowd, 0)
            assert sum(x != y for x, y in zip(child, [0, 1, 2, 3, 99], strict=True)) == 1
            assert len(set(child)) == 5 and child[0] == 0 and child[-1] == 99
        assert mutated(crowd, 1, pool, seeded(seed)) == 0


def test_speed_mutation_changes_one_speed():
    for seed in range(50):
        crowd = crowd_of([0, 1, 2, 99])
        assert speed_mutated(crowd, 0, 4, seeded(seed)) == 1
        row = crowd.order[1]
        assert sorted(crowd.speeds[row, :3] != 0) == [False, False, True] and crowd.speeds[row, :3].max() <= 3
        assert genes(crowd, 0) == [0, 1, 2, 99]


def test_the_wheel_is_quadratic_in_the_rank():
    slots = np.diff(ranking(30), prepend=0.0)
    assert slots[0] / slots[-1] == pytest.approx(900.0) and slots[10] / slots[20] == pytest.approx(4.0)


def test_offspring_replace_the_worst_and_keep_the_order():
    crowd = crowd_of(*([0, 99],) * 6)
    crowd.values[:] = (1.0, 2.0, 3.0, 4.0, 8.0, 9.0, 0.5, 5.0)
    settle(crowd, 6, 2)
    assert crowd.values[crowd.order[:6]].tolist() == [0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
