"""The report of a search: starts with the nearest that each came, and a picture that shows the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sitl.search.best_values import best_values
from sitl.search.goals import FOUND, Goal
from sitl.search.search import IMPOSSIBLE, Evaluation, Generation, first_bases
from sitl.search.search_report import SearchResult, page
from tests.sitl.search.test_search import CAMPAIGN, a_find

FIND = a_find("dropout")


def generation(start: int, number: int, *distances: float) -> Generation:
    base = first_bases(CAMPAIGN)[start - 1]
    runs = [
        Evaluation(replace(base, off_model=0.001 * n), FIND.result, one, (FIND,) if one == FOUND else ())
        for n, one in enumerate(distances)
    ]
    return Generation(start, number, base, tuple(runs))


GENERATIONS = [
    generation(1, 1, 0.5, 0.3, IMPOSSIBLE),
    generation(1, 2, 0.4, FOUND),
    generation(2, 1, 0.6, 0.2, 0.7),
]


def test_the_nearest_so_far_begins_again_with_each_start_and_finds_stand_apart() -> None:
    (panel,) = best_values(Goal.COLLISION, GENERATIONS).axes
    first, second = panel.get_lines()
    assert list(first.get_xdata()) == [1, 2, 4] and list(first.get_ydata()) == [0.5, 0.3, 0.3]
    assert list(second.get_xdata()) == [6, 7, 8] and list(second.get_ydata()) == [0.6, 0.2, 0.2]
    crosses = np.asarray(panel.collections[1].get_offsets())
    assert crosses[:, 0].tolist() == [5.0]


def test_each_start_has_a_row_with_what_it_came_to() -> None:
    text = page(CAMPAIGN, SearchResult(Goal.COLLISION, 100, GENERATIONS, [], 0, 0, ended=False))
    rows = [
        [cell.partition(">")[2].partition("<")[0] for cell in row.split("<td")[1:]]
        for row in text.rpartition("<tbody>")[2].split("<tr>")[1:]
    ]
    assert rows == [
        ["cylinders", "1", "0", "2", "5", "0.300", "collision"],
        ["yard", "2", "0", "1", "3", "0.200", "-"],
    ]
    assert "8 of 100 runs in 3 generations of 2 starts" in text and "The search was stopped" in text
    assert "None is made small yet" in text
