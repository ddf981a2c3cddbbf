"""The report of a search: starts with the nearest that each came, and a picture that shows the way."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sitl.campaign.policies import Policy
from sitl.search import search_report
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


RESULT = SearchResult(
    Goal.COLLISION, 100, GENERATIONS, [], 0, 0, False, [], ("campaign", "c.toml", "--search", "collision")
)


def rows(text: str) -> list[list[str]]:
    return [
        [re.sub(r"<.*?>", "", cell.partition(">")[2]).strip() for cell in row.split("<td")[1:]]
        for row in text.rpartition("<tbody>")[2].split("<tr>")[1:]
    ]


def test_the_nearest_so_far_begins_again_with_each_start_and_finds_stand_apart() -> None:
    (panel,) = best_values(Goal.COLLISION, GENERATIONS).axes
    first, second = panel.get_lines()
    assert list(first.get_xdata()) == [1, 2, 4] and list(first.get_ydata()) == [0.5, 0.3, 0.3]
    assert list(second.get_xdata()) == [6, 7, 8] and list(second.get_ydata()) == [0.6, 0.2, 0.2]
    crosses = np.asarray(panel.collections[1].get_offsets())
    assert crosses[:, 0].tolist() == [5.0]
    (panel,) = best_values(Goal.COLLISION, GENERATIONS[:1]).axes
    assert all(tick == round(tick) for tick in panel.get_xticks()), "runs are whole"


def test_each_start_has_a_row_with_what_it_came_to() -> None:
    text = page(CAMPAIGN, RESULT)
    assert rows(text.partition("<h2>Starts")[2].partition("<h2>")[0]) == [
        ["cylinders", "1", "0", "2", "5", "0.300", "collision"],
        ["yard", "2", "0", "1", "3", "0.200", "-"],
    ]
    assert "8 of 100 runs in 3 generations of 2 starts" in text and "The search was stopped" in text
    assert "None is made small yet" in text


def test_every_find_has_its_command_also_one_that_is_not_made_small(monkeypatch: pytest.MonkeyPatch) -> None:
    besides = replace(a_find("noise_m"), rule=Policy.NOTHING_REFUSED)
    result = replace(RESULT, found=[FIND, besides, replace(FIND, rule=Policy.ENDS)])
    found = rows(page(CAMPAIGN, result).partition("<h2>Every find")[2])
    assert [row[0] for row in found] == ["collision no-end", "refused"], "a row a run"
    assert [row[-1] for row in found] == [
        f"rover-sitl campaign c.toml --search collision --replay {find.spec.id} --record out/{find.spec.id}"
        for find in (FIND, besides)
    ]
    monkeypatch.setattr(search_report, "MOST_FINDS", 1)
    text = page(CAMPAIGN, result)
    assert "The first 1 of 2 runs" in text and besides.spec.id not in text
    text = page(CAMPAIGN, replace(RESULT, generations=GENERATIONS[2:], tries=1))
    assert "Every find" not in text and "in 1 generation of 2 starts, and 1 run that made" in text
