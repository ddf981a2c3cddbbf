"""Straight on, and a search only round what is in the way: squares, lines, and what it gains over the whole map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.grid import Cell
from companion.mapping.map_files import load_map
from companion.planning.papers.sedighi_local import Square, straight
from companion.planning.problem import Budget, PlanningProblem, PlanResult
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings

MAPS = Path(__file__).resolve().parents[4] / "missions" / "maps"


def plan(name: str, problem: PlanningProblem, seed: int = 0) -> PlanResult:
    return make_planner(name, PlannerSettings()).plan(problem, Budget(), np.random.default_rng(seed))


@given(*[st.integers(0, 60)] * 4)
def test_the_line_goes_from_neighbour_to_neighbour_near_the_straight_one(x: int, y: int, to_x: int, to_y: int) -> None:
    fields = np.array(straight(Cell(x, y), Cell(to_x, to_y)))
    assert tuple(fields[0]) == (x, y) and tuple(fields[-1]) == (to_x, to_y)
    assert len(fields) == 1 + abs(to_x - x) + abs(to_y - y)
    assert (np.abs(np.diff(fields, axis=0)).sum(axis=1) == 1).all()
    length = np.hypot(to_x - x, to_y - y)
    aside = np.abs((fields[:, 0] - x) * (to_y - y) - (fields[:, 1] - y) * (to_x - x)) / max(length, 1e-9)
    assert aside.max() <= 0.75


def test_on_open_ground_it_searches_nothing() -> None:
    result = plan("sedighi-local", PlanningProblem(np.full((20, 30), 0.5), Cell(1, 1), Cell(28, 17)))
    assert result.path is not None and result.epochs == 0
    assert len(result.path.cells) == 1 + 27 + 16


def test_it_searches_only_beside_the_obstacle() -> None:
    """Far from the obstacle the way is the straight line; a wall beyond the square is never looked at."""
    weights = np.full((21, 60), 0.5)
    weights[8:13, 28:31] = 1.0
    problem = PlanningProblem(weights, Cell(0, 10), Cell(59, 10))
    found = plan("sedighi-local", problem)
    assert found.path is not None
    cells = np.array(found.path.cells)
    assert set(cells[cells[:, 0] < 26][:, 1]) == set(cells[cells[:, 0] > 33][:, 1]) == {10}
    away = weights.copy()
    away[0, :20] = away[20, 40:] = 1.0
    same = plan("sedighi-local", PlanningProblem(away, Cell(0, 10), Cell(59, 10)))
    assert same.path is not None and same.path.cells == found.path.cells


def test_a_square_without_a_way_is_grown() -> None:
    """A wall to both sides of the obstacle's square; the way is behind its end."""
    weights = np.full((40, 40), 0.5)
    weights[5:40, 20] = 1.0
    result = plan("sedighi-local", PlanningProblem(weights, Cell(15, 30), Cell(25, 30)))
    assert result.path is not None and min(cell.y for cell in result.path.cells) < 5
    assert Square(10, 10, 20, 20).grown((40, 24)) == Square(5, 5, 24, 25)


@pytest.mark.parametrize("name", ["clutter", "known-1", "known-3"])
def test_on_large_maps_its_ways_are_far_shorter_than_those_of_a_search_on_the_whole_map(name: str) -> None:
    weights = load_map(MAPS / f"{name}.png").weights
    height, width = weights.shape
    free = np.argwhere(weights < 1.0)

    def nearest(x: int) -> Cell:
        y, x = free[np.argmin(np.hypot(free[:, 1] - x, free[:, 0] - height // 2))]
        return Cell(int(x), int(y))

    problem = PlanningProblem(weights, nearest(1), nearest(width - 2))
    least = plan("astar", problem).path
    local, whole = ([plan(name, problem, seed).path for seed in range(3)] for name in ("sedighi-local", "sedighi"))
    assert least is not None and all(path is not None for path in local)
    costs = [path.cost / least.cost for path in local if path is not None]
    assert max(costs) < 1.6
    assert all(path is None or path.cost > 2.0 * max(costs) * least.cost for path in whole)
