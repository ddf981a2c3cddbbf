import numpy as np
import pytest

from companion.core.grid import Cell
from companion.planning.graph_search.dijkstra import Dijkstra
from companion.planning.problem import MIN_WEIGHT, Budget, PlanningProblem, PlanStatus, path_cost
from companion.settings import PlannerSettings
from tests.support.paths import is_path
from tests.support.planning_maps import drawn, movingai_map, one_obstacle
from tests.support.shared_data import SHARED, needs_shared

RNG = np.random.default_rng(0)


def plan(problem):
    return Dijkstra(PlannerSettings()).plan(problem, Budget(), RNG)


def cost_to(weights, target, corner_cutting):
    path = plan(PlanningProblem(weights, Cell(0, 0), target, corner_cutting)).path
    return np.inf if path is None else path.cost


def steps_of(weights, corner_cutting):
    """Every allowed step as (from, to, cost), by the rules as written down, one field after the other."""
    height, width = weights.shape
    free = [(x, y) for y in range(height) for x in range(width) if weights[y, x] < 1.0]
    known = set(free)
    for x, y in free:
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            to = (x + dx, y + dy)
            if to not in known:
                continue
            if dx and dy and not corner_cutting and not ({(x + dx, y), (x, y + dy)} <= known):
                continue
            yield (x, y), to, np.hypot(dx, dy) * max(weights[to[1], to[0]], MIN_WEIGHT)


def random_weights(seed, height=23, width=31, blocked=0.3):
    rng = np.random.default_rng(seed)
    weights = rng.random((height, width)) ** 3
    weights[rng.random((height, width)) < blocked] = 1.0
    weights[:4, :4] = 0.25
    return weights


@pytest.mark.parametrize("corner_cutting", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_every_distance_is_scipys(seed, corner_cutting):
    from scipy.sparse import csr_matrix  # large, like networkx; only the workers that run these tests load them
    from scipy.sparse.csgraph import dijkstra as scipy_dijkstra

    weights = random_weights(seed)
    width = weights.shape[1]
    rows, columns, costs = zip(
        *((a[1] * width + a[0], b[1] * width + b[0], cost) for a, b, cost in steps_of(weights, corner_cutting)),
        strict=True,
    )
    graph = csr_matrix((costs, (rows, columns)), shape=(weights.size, weights.size))
    expected = scipy_dijkstra(graph, indices=0).reshape(weights.shape)
    found = np.array(
        [[cost_to(weights, Cell(x, y), corner_cutting) for x in range(width)] for y in range(len(weights))]
    )
    assert np.array_equal(np.isinf(found), np.isinf(expected))
    reached = np.isfinite(expected)
    assert reached.sum() > 20
    assert found[reached] == pytest.approx(expected[reached], rel=1e-12)


@pytest.mark.parametrize("corner_cutting", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_paths_are_as_cheap_as_networkxs(seed, corner_cutting):
    import networkx as nx

    weights = random_weights(seed, blocked=0.2)
    graph = nx.DiGraph()
    graph.add_weighted_edges_from(steps_of(weights, corner_cutting))
    costs = nx.single_source_dijkstra_path_length(graph, (0, 0))
    reached = 0
    for x, y in [(30, 22), (15, 11), (30, 0), (0, 22), (7, 19)]:
        result = plan(PlanningProblem(weights, Cell(0, 0), Cell(x, y), corner_cutting))
        assert (result.path is not None) == ((x, y) in costs)
        if result.path is not None:
            reached += 1
            assert result.path.cost == pytest.approx(costs[x, y], rel=1e-12)
            assert result.path.cost == pytest.approx(path_cost(weights, result.path.cells), rel=1e-12)
            assert is_path(weights, result.path.cells, corner_cutting)
    assert reached > 0


@pytest.mark.parametrize("name", ["arena", "den101d", "isound1", "lak104d"])
@needs_shared
def test_lengths_are_movingais_optima(name):
    folder = SHARED / "data" / "movingai" / "dao"
    weights = movingai_map(folder / f"{name}.map")
    lines = (folder / f"{name}.map.scen").read_text(encoding="ascii").splitlines()[1:]
    for line in lines[:: max(1, len(lines) // 60)]:
        _, _, _, height, sx, sy, gx, gy, optimum = line.split("\t")
        top = int(height) - 1
        result = plan(PlanningProblem(weights, Cell(int(sx), top - int(sy)), Cell(int(gx), top - int(gy))))
        assert result.path is not None
        # The scenarios count sqrt 2 with eight decimals.
        assert result.path.length_fields == pytest.approx(float(optimum), abs=1e-4)


def test_no_path_is_proved():
    weights = drawn(".....", ".###.", ".#.#.", ".###.", ".....")
    assert plan(PlanningProblem(weights, Cell(0, 0), Cell(2, 2))).status is PlanStatus.NO_PATH


def test_a_diagonal_gap_is_passed_only_where_corners_may_be_cut():
    weights = drawn("..#..", ".#...", "#....", ".....")
    ends = Cell(0, 3), Cell(4, 0)
    assert plan(PlanningProblem(weights, *ends)).status is PlanStatus.NO_PATH
    assert plan(PlanningProblem(weights, *ends, True)).status is PlanStatus.FOUND


def test_ends_on_an_obstacle_or_outside_give_no_path():
    weights = drawn("...", ".#.", "...")
    for start, target in [((1, 1), (0, 0)), ((0, 0), (1, 1)), ((-1, 0), (0, 0)), ((0, 0), (3, 0)), ((0, 0), (0, 9))]:
        assert plan(PlanningProblem(weights, Cell(*start), Cell(*target))).status is PlanStatus.NO_PATH


def test_preferred_ground_is_followed():
    weights = drawn("000000", "055550", "055550")
    result = plan(PlanningProblem(weights, Cell(0, 0), Cell(5, 0)))
    assert result.path is not None
    assert {Cell(2, 2), Cell(3, 2)} <= set(result.path.cells)
    assert result.path.cost == pytest.approx(MIN_WEIGHT * (5 + 2 * np.sqrt(2)))


def test_equally_short_ways_have_few_bends():
    problem = PlanningProblem(np.full((20, 40), 0.5), Cell(0, 5), Cell(30, 12))
    result = plan(problem)
    assert result.path is not None
    cells = np.array(result.path.cells)
    turns = (np.diff(np.diff(cells, axis=0), axis=0) != 0).any(axis=1).sum()
    assert turns == 1


def test_start_and_target_in_one_field():
    result = plan(PlanningProblem(drawn("..", ".."), Cell(1, 1), Cell(1, 1)))
    assert result.path is not None and result.path.cells == (Cell(1, 1),) and result.path.cost == 0.0


def test_the_map_is_left_alone():
    problem = one_obstacle()
    before = problem.weights.copy()
    plan(problem)
    assert np.array_equal(before, problem.weights)
