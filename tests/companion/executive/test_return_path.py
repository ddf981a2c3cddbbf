"""The way back, and the place that a rover with little power left goes to."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid, empty_grid
from companion.executive.return_path import Refuge, Trail, refuges
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import is_clear
from companion.planning.registry import make_planner
from companion.settings import MappingSettings, PlannerSettings


def trail(*cells: tuple[int, int]) -> Trail:
    found = Trail()
    for cell in cells:
        found.enter(Cell(*cell))
    return found


def test_the_trail_leads_back_over_every_field_between() -> None:
    found = trail((0, 0), (1, 0), (4, 3))
    assert found.back() == ((4, 3), (3, 2), (2, 1), (1, 0), (0, 0))
    assert found.length_fields == pytest.approx(1.0 + 3.0 * 2**0.5)


def test_loops_are_cut_off() -> None:
    assert trail((0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 0), (1, -1)).back() == ((1, -1), (1, 0), (0, 0))
    assert trail((0, 0), (0, 0), (3, 0), (0, 0)).back() == ((0, 0),)


def driven_past(evidence: EvidenceMap, east_m: float) -> Trail:
    """North along a column of fields, at this distance east of the map's edge."""
    found = Trail()
    for north_m in np.arange(1.5, 7.6, 0.1):
        point = NedPoint(float(north_m), east_m)
        found.enter(evidence.base.cell_at(point), point)
    return found


@pytest.mark.parametrize(("stands_east_m", "open_again"), [(4.6, True), (4.0, False)])
def test_what_the_rover_passed_beside_does_not_bar_its_way_back_and_what_came_after_does(
    stands_east_m: float, open_again: bool
) -> None:
    evidence = ground()
    found = driven_past(evidence, 4.05)
    y, x = (int(v / evidence.evidence_m) for v in (4.5, stands_east_m))
    evidence.log_odds[y, x] = 3.0
    evidence.grid.weights[4, 4] = OBSTACLE
    assert not is_clear(evidence.grid, found.back())
    assert is_clear(evidence.grid, found.back(), found.driven(evidence)) is open_again
    assert found.driven(ground((4, 4))) == frozenset(), "what the mission closed stays closed"


def test_fields_off_the_map_are_never_clear() -> None:
    found, evidence = Trail(), ground()
    for y in (2, 1, 0, -1):
        found.enter(Cell(4, y), NedPoint(y + 0.5, 4.5))
    evidence.grid.weights[1, 4] = OBSTACLE
    assert not is_clear(evidence.grid, found.back(), found.driven(evidence))


Steps = st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=1, max_size=60)


@given(Steps)
def test_a_trail_is_a_walk_without_repetition_from_here_to_the_start(cells: list[tuple[int, int]]) -> None:
    back = trail(*cells).back()
    assert (back[0], back[-1]) == (cells[-1], back[-1]) and len(set(back)) == len(back)
    assert all(max(abs(a.x - b.x), abs(a.y - b.y)) == 1 for a, b in pairwise(back))
    if len(set(cells)) == len(cells):
        assert back[-1] == cells[0] or cells[0] in back


# --- where to --------------------------------------------------------------------------------------------------------


def ground(*walls: tuple[int, int]) -> EvidenceMap:
    """20 x 20 fields of 1 m, corner at 0, 0."""
    weights = empty_grid(20, 20).weights.copy()
    for x, y in walls:
        weights[y, x] = OBSTACLE
    return new_map(Grid(weights, 1.0, NedPoint(0.0, 0.0)), 0.35, MappingSettings())


def sought(
    evidence: EvidenceMap, way: Trail, *rally: tuple[float, float], start: tuple[int, int] = (1, 1)
) -> list[Refuge]:
    """``rally``: x and y in metres."""
    cell = Cell(*start)
    home = ResolvedTarget("start", evidence.base.centre_of(cell), cell, 0.0, OnBlocked.HOLD, None)
    here = evidence.base.centre_of(way.back()[0])
    planner = make_planner("dijkstra", PlannerSettings())
    return refuges(home, way, [NedPoint(y, x) for x, y in rally], here, evidence, planner)


ALONG = trail((1, 1), (1, 15), (12, 15))
"""25 m."""


def test_without_rally_points_it_goes_back_the_way_it_came() -> None:
    (only,) = sought(ground(), ALONG)
    assert only.place.name == "start" and only.way == ALONG.back() and only.length_m == pytest.approx(25.0)


def test_rally_points_with_a_shorter_way_come_first_the_nearest_of_them_at_the_head() -> None:
    found = sought(ground(), ALONG, (12.5, 3.5), (15.5, 15.5))
    assert [one.place.name for one in found] == ["rally point 2", "rally point 1", "start"]
    assert found[0].length_m == pytest.approx(3.0) and found[0].way == ()


def test_a_rally_point_behind_a_wall_counts_with_the_way_round_it() -> None:
    wall = [(14, y) for y in range(20)]
    assert [one.place.name for one in sought(ground(*wall), ALONG, (15.5, 15.5))] == ["start"], "there is no way"
    gap = [(14, y) for y in range(1, 20)]
    assert [one.place.name for one in sought(ground(*gap), ALONG, (15.5, 15.5))] == ["start"], "too far round"
    near = [(14, y) for y in range(10, 20)]
    (first, _) = sought(ground(*near), ALONG, (15.5, 15.5))
    assert first.place.name == "rally point 1" and 11.0 < first.length_m < 16.0


@pytest.mark.parametrize("place", [(40.5, 15.5), (3.5, 3.5)], ids=["off the map", "closed"])
def test_places_that_cannot_be_driven_to_are_none(place: tuple[float, float]) -> None:
    assert [one.place.name for one in sought(ground((3, 3)), ALONG, place)] == ["start"]


def test_a_trail_that_does_not_lead_to_the_start_is_not_followed() -> None:
    (only,) = sought(ground(), trail((5, 5), (9, 9)))
    assert only.way == () and only.length_m == pytest.approx(float(np.hypot(8.0, 8.0)))
