"""Scenario files of the MovingAI benchmarks."""

import numpy as np
import pytest

from companion.bench.cases import map_case
from companion.bench.contestants import our_planner
from companion.bench.movingai import ScenarioFileError, read_scenarios, spread
from companion.core.grid import Cell
from companion.planning.problem import Budget
from companion.settings import PlannerSettings
from tests.support.shared_data import SHARED, needs_shared

SCENARIOS = "version 1\n0\tm.map\t8\t6\t0\t3\t7\t3\t8.5\n1\tm.map\t8\t6\t0\t0\t7\t0\t7\n"


def test_scenarios_are_read_with_y_upward(tmp_path):
    file = tmp_path / "m.map.scen"
    file.write_text(SCENARIOS)
    first, second = read_scenarios(file)
    assert (first.start, first.target, first.optimum_fields) == (Cell(0, 2), Cell(7, 2), 8.5)
    assert second.start == Cell(0, 5)
    assert spread([first, second] * 50, 3) == [first, first, second]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("hello\n", "line 1"),
        ("version 1\n0 m 8 6 0 3 7\n", "line 2"),
        ("version 1\n\n0 m 8 6 0 3 7 x 8\n", "line 3"),
    ],
)
def test_a_bad_scenario_file_names_its_line(tmp_path, text, place):
    file = tmp_path / "m.scen"
    file.write_text(text)
    with pytest.raises(ScenarioFileError, match=place):
        read_scenarios(file)


@needs_shared
def test_costs_agree_with_the_benchmark_files():
    file = SHARED / "data" / "movingai" / "dao" / "arena.map"
    case = map_case(file, 40)
    known = {(s.start, s.target): s.optimum_fields for s in read_scenarios(file.with_name("arena.map.scen"))}
    solve = our_planner("dijkstra", PlannerSettings(), Budget()).solve
    for ends in case.ends:
        cells = solve(case.weights, *ends, 0)()
        length = np.hypot(*np.diff(cells, axis=0).T).sum()
        assert length == pytest.approx(known[ends], abs=1e-4)
