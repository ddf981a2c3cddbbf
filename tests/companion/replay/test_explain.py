"""A decision in words: candidates and their costs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.core.frames import Pose
from companion.core.grid import Cell, empty_grid
from companion.navigation.field_step import NavState
from companion.planning.problem import Path
from companion.planning.raster import CellArray
from companion.replay.explain import Candidate, _rest_of_path, _Scene, cost_of, cost_text, map_line, motion_lines
from tests.companion.control.test_motion_controller import controller, view
from tests.companion.control.test_motion_ground import PATH, ground


def cells(*pairs: tuple[int, int]) -> CellArray:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def test_the_cost_of_a_path_on_a_grid() -> None:
    grid = empty_grid(4, 3)
    straight = cost_of(grid, cells((0, 0), (1, 0), (2, 0)))
    weights = grid.weights.copy()
    weights[0, 1] = 0.9
    assert cost_of(grid.with_weights(weights), cells((0, 0), (1, 0), (2, 0))) > straight > 0.0
    assert cost_of(grid, cells()) == 0.0


@pytest.mark.parametrize("outside", [(-1, 0), (0, -1), (4, 0), (0, 3)])
def test_a_path_that_leaves_the_grid_has_no_finite_cost(outside: tuple[int, int]) -> None:
    assert cost_of(empty_grid(4, 3), cells((0, 0), outside)) == math.inf


def test_cost_and_length_of_a_candidate() -> None:
    path = Path(cells((0, 0), (1, 0), (2, 0)), 2.0)
    assert "2.00" in cost_text(Candidate("a", "", path, 2.0)) and "curve" not in cost_text(
        Candidate("a", "", path, 2.0)
    )
    assert "1.75" in cost_text(Candidate("a", "", path, 2.0, curve_cost=1.75))
    assert cost_text(Candidate("a", "", None, math.inf)) == "no path"


def test_what_is_left_of_a_path_begins_where_the_rover_is_and_costs_what_the_navigator_compares() -> None:
    grid, path = empty_grid(5, 1), Path(cells((0, 0), (1, 0), (2, 0), (3, 0), (4, 0)), 2.0)
    state = NavState(Cell(4, 0), (Cell(0, 0),), path)
    scene = _Scene(Pose(0.0, 2.0, 0.0, 0.0), state, grid, grid, grid, grid.weights < 1.0)
    here = grid.cell_at(scene.pose.point)
    rest = _rest_of_path(scene)
    assert rest.path is not None and rest.path.cells == tuple(Cell(x, 0) for x in range(here.x, 5)) and here.x > 0
    assert rest.cost == cost_of(grid, rest.path.cell_array) < path.cost and rest.note == "clear"


@pytest.mark.parametrize(
    ("open_fields", "seen", "says"),
    [
        (400, 1, "1 are seen (less than 1%), 0 are barred by obstacles"),
        (400, 300, "300 are seen (75%), 0 are barred by obstacles"),
        (241_600, 241_600, "241600 are seen (100%), 0 are barred by obstacles"),
        (400, 0, "0 are seen (0%), 0 are barred by obstacles"),
    ],
)
def test_what_a_fence_closes_does_not_count_as_unseen_or_as_an_obstacle(open_fields: int, seen: int, says: str) -> None:
    """Inside a wide keep-in area it said that 0 % were seen, and that all beyond it were obstacles."""
    closed = np.arange(241_600) >= open_fields
    shut = "241200 closed by fences or a given map; of the other 400, " if closed.any() else ""
    assert map_line(closed, closed, (np.arange(241_600) < seen) | closed) == shut + says


@pytest.mark.parametrize("shut_in", [True, False])
def test_a_chosen_motion_that_touches_something_is_called_so(shut_in: bool) -> None:
    """As in the list above it: a cost of more than a thousand seconds stands for that."""
    leads, evidence = controller(), ground()
    if shut_in:
        evidence.log_odds[:] = 3.0
    leads.follow(PATH, view(evidence, Pose(3.0, 10.0, 0.0, 0.0), 1.0))
    assert leads.choice is not None
    (chosen,) = [line for line in motion_lines(leads.choice) if line.startswith("chosen: ")]
    assert chosen.startswith("chosen: touches something; the controller" if shut_in else "chosen: cost ")
