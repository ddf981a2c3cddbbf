"""The window of ground that motions are judged on, from maps drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from companion.control.motion_ground import AHEAD_M, AROUND_M, Window, look_round
from companion.control.motion_kernels import Body
from companion.control.reference_path import STEP_M, ReferencePath
from companion.core.frames import NedPoint
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_edits import forget_weak_evidence
from companion.settings import Settings

SETTINGS = Settings()
BODY = Body(np.zeros(1), 0.3, 0.3)
HERE, BEYOND = NedPoint(3.0, 10.0), NedPoint(11.0, 10.0)
PATH = ReferencePath(np.column_stack((np.arange(3.0, 17.1, STEP_M), np.full(57, 10.0))))


def ground() -> EvidenceMap:
    """20 x 20 m, all seen free."""
    evidence = new_map(empty_grid(20, 20), 0.35, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    evidence.seen.add(0, 0, *reversed(evidence.log_odds.shape))
    return evidence


def wall(evidence: EvidenceMap, north_m: float, west_m: float, east_m: float, value: float = 3.0) -> None:
    y, left, right = (round(v / evidence.evidence_m) for v in (north_m, west_m, east_m))
    evidence.log_odds[y, left:right] = value


def seen(evidence: EvidenceMap, body: Body = BODY) -> Window:
    return look_round(evidence, HERE, PATH, body, 2.0)


def togo_s(window: Window, point: NedPoint) -> float:
    x, y = (int(v / window.ground.togo_cell_m) for v in window.place(point))
    return float(window.ground.togo_s[y, x])


def test_it_holds_the_path_and_its_surroundings_and_counts_to_its_far_end() -> None:
    window = seen(ground())
    height_m, width_m = (cells * window.ground.cell_m for cells in window.ground.gap_m.shape)
    assert height_m == pytest.approx(AHEAD_M + 2 * AROUND_M, abs=0.6) and width_m == pytest.approx(
        2 * AROUND_M, abs=0.6
    )
    assert togo_s(window, NedPoint(HERE.north_m + AHEAD_M - 0.1, HERE.east_m)) < 0.2
    assert togo_s(window, HERE) == pytest.approx(AHEAD_M / 2.0, rel=0.05)


def test_gaps_are_told_from_the_surface() -> None:
    evidence = ground()
    wall(evidence, 6.0, 8.0, 12.0)
    window = seen(evidence)
    x, y = (int(v / window.ground.cell_m) for v in window.place(NedPoint(5.0, 10.0)))
    assert window.ground.gap_m[y, x] == pytest.approx(1.0 - 0.0625, abs=0.13)
    assert window.ground.seen_m[y, x] == window.ground.gap_m[y, x]


def test_the_ground_that_the_rover_stands_on_counts_as_seen_and_none_beyond() -> None:
    evidence = ground()
    evidence.log_odds.fill(0.0)
    window = seen(evidence)

    def seen_m(point: NedPoint) -> float:
        x, y = (int(v / window.ground.cell_m) for v in window.place(point))
        return float(window.ground.seen_m[y, x])

    assert seen_m(HERE) > BODY.radius_m
    assert seen_m(NedPoint(HERE.north_m - 1.0, HERE.east_m)) < 0.0


def test_where_it_begins_more_of_what_is_beside_it_counts_as_seen() -> None:
    """So much a lidar of 90 degrees needs to drive on. Later it has seen what is beside it, or something hides it."""
    evidence = ground()
    evidence.log_odds.fill(0.0)
    spare_m = {}
    for came_here in (False, True):
        window = look_round(evidence, HERE, PATH, BODY, 2.0, came_here=came_here)
        x, y = (int(v / window.ground.cell_m) for v in window.place(HERE))
        spare_m[came_here] = window.ground.seen_m[y, x] - BODY.radius_m
    assert 0.0 < spare_m[True] < 0.1 < spare_m[False] < 0.25


def test_an_obstacle_that_was_forgotten_counts_as_unseen_also_beside_the_rover() -> None:
    evidence = ground()
    evidence.log_odds.fill(0.0)
    wall(evidence, HERE.north_m, 10.5, 10.6)
    assert forget_weak_evidence(evidence, HERE, 2.5)
    window = seen(evidence)
    x, y = (int(v / window.ground.cell_m) for v in window.place(HERE))
    assert window.ground.seen_m[y, x] < 0.5 < window.ground.gap_m[y, x]


def test_what_the_mission_closes_keeps_the_rovers_middle_away_and_not_its_sides_once_more() -> None:
    """Two fences whose fields, grown by the rover's radius, leave 0.5 m between them. The rover is 0.8 m wide."""
    evidence, wide = new_map(empty_grid(80, 80, 0.25), 0.4, SETTINGS.mapping), Body(np.zeros(1), 0.4, 0.4)
    evidence.log_odds.fill(-1.0)
    evidence.base.weights[32:36, :39] = evidence.base.weights[32:36, 41:] = 1.0
    assert np.isfinite([togo_s(seen(evidence, wide), place) for place in (HERE, BEYOND)]).all(), "its middle has room"
    coarse = ground()  # in fields so large that they did not grow, nothing is taken off
    coarse.base.weights[8] = 1.0
    x, y = (int(v / coarse.evidence_m) for v in (10.5 - seen(coarse).corner.east_m, 8.05 - seen(coarse).corner.north_m))
    assert seen(coarse).ground.gap_m[y, x] <= 0.0
    evidence.base.weights[32:36] = 1.0
    assert np.isinf(togo_s(seen(evidence), BEYOND)) or np.isinf(togo_s(seen(evidence), HERE))


def test_a_wall_is_gone_round_and_a_narrow_gap_in_it_is_no_way() -> None:
    evidence = ground()
    wall(evidence, 8.0, 7.0, 11.0)
    free_s, round_s = togo_s(seen(ground()), HERE), togo_s(seen(evidence), HERE)
    assert np.isfinite(round_s) and round_s > free_s + 0.1
    wall(evidence, 8.0, 0.0, 20.0)
    wall(evidence, 8.0, 9.75, 10.25, -1.0)
    assert np.isinf(togo_s(seen(evidence), BEYOND))


def test_where_there_is_hardly_room_each_metre_takes_much_longer() -> None:
    """Longer than a motion costs there, so that it seems worth it."""

    def metre_s(gap_m: float) -> float:
        evidence = ground()
        for row in np.arange(5.0, 7.0, evidence.evidence_m):
            wall(evidence, float(row), 5.0, 10.0 - 0.5 * gap_m)
            wall(evidence, float(row), 10.0 + 0.5 * gap_m, 15.0)
        window = seen(evidence)
        return togo_s(window, NedPoint(5.5, 10.0)) - togo_s(window, NedPoint(6.5, 10.0))

    assert metre_s(0.8) > 4.0 * metre_s(1.4) > 4.0 * 0.5


def test_where_the_path_is_closed_farther_ahead_it_counts_up_to_there() -> None:
    """The planner's fields are coarser: its path may lead through a gap that is too narrow for a closer look."""
    evidence = ground()
    wall(evidence, 12.0, 0.0, 20.0)
    window = seen(evidence)
    assert togo_s(window, HERE) == pytest.approx((12.0 - 0.4 - HERE.north_m) / 2.0, abs=0.6)
    assert togo_s(window, NedPoint(11.4, HERE.east_m)) < 0.2 and not window.ground.ends
    wall(evidence, HERE.north_m + 0.8, 0.0, 20.0)
    assert np.isinf(togo_s(seen(evidence), HERE)), "closed here"


def test_unseen_ground_takes_longer_and_counts_as_near() -> None:
    evidence = ground()
    evidence.log_odds[round(7.0 / evidence.evidence_m) : round(9.0 / evidence.evidence_m)] = 0.0
    window = seen(evidence)
    assert togo_s(seen(ground()), HERE) < togo_s(window, HERE) < 1.3 * togo_s(seen(ground()), HERE)
    x, y = (int(v / window.ground.cell_m) for v in window.place(NedPoint(6.5, 10.0)))
    assert window.ground.seen_m[y, x] < 0.6 < window.ground.gap_m[y, x]


def test_what_the_mission_or_experience_closed_is_an_obstacle() -> None:
    evidence = ground()
    assert np.isfinite(togo_s(seen(evidence), BEYOND))
    evidence.base.weights[8, :] = 1.0
    assert np.isinf(togo_s(seen(evidence), BEYOND))
    evidence = ground()
    evidence.penalty[8, :] = 0.6
    assert np.isinf(togo_s(seen(evidence), BEYOND))


def test_a_field_closed_by_experience_under_the_rover_does_not_keep_it_there() -> None:
    evidence = ground()
    evidence.penalty[3:9, 10] = 1.0
    window = seen(evidence)
    at, ahead = (
        tuple(int(v / window.ground.cell_m) for v in window.place(place)) for place in (HERE, NedPoint(6.5, 10.5))
    )
    assert window.ground.gap_m[at[1], at[0]] > 0.15 and window.ground.gap_m[ahead[1], ahead[0]] < 0.0


@pytest.mark.parametrize("fields", [4, 5])
def test_the_edge_of_the_map_is_closed_on_all_sides_however_many_cells_it_has(fields: int) -> None:
    """Five fields of five cells are 25: the window has whole cells of two."""
    mapping = SETTINGS.mapping.model_copy(update={"evidence_m": 0.2})
    evidence = new_map(empty_grid(fields, fields), 0.35, mapping)
    evidence.log_odds.fill(-1.0)
    assert evidence.log_odds.shape[0] == 5 * fields
    middle = 0.5 * fields
    path = ReferencePath(np.array([(middle, middle), (middle + 0.2, middle)]))
    gap_m = look_round(evidence, NedPoint(middle, middle), path, BODY, 2.0).ground.gap_m
    for edge in (gap_m[0, :], gap_m[-1, :], gap_m[:, 0], gap_m[:, -1]):
        assert edge.max() <= 0.0


def test_beyond_the_window_nothing_is_known_to_be_free() -> None:
    """A wall just outside would be in neither field of distances."""
    window = seen(ground())
    x, y = (int(v / window.ground.cell_m) for v in window.place(NedPoint(HERE.north_m, HERE.east_m + AROUND_M - 0.5)))
    assert window.ground.gap_m[y, x] > 1.0 and window.ground.seen_m[y, x] < 0.6


@pytest.mark.parametrize("east_m", [0.1, 19.9])
def test_at_the_edge_of_the_map_it_is_smaller(east_m: float) -> None:
    path = replace(PATH, points=np.column_stack((PATH.points[:, 0], np.full(57, east_m))))
    window = look_round(ground(), NedPoint(3.0, east_m), path, BODY, 2.0)
    assert window.ground.gap_m.shape[1] * window.ground.cell_m == pytest.approx(AROUND_M, abs=0.6)
    assert window.ground.togo_s.shape[0] * 2 == window.ground.gap_m.shape[0]


def test_the_edge_of_the_map_is_no_ground_but_that_of_the_window_is() -> None:
    evidence = ground()
    inside, beside = seen(evidence), look_round(evidence, NedPoint(3.0, 1.0), PATH, BODY, 2.0)
    x, y = beside.place(NedPoint(3.0, 0.3))
    row, column = int(y / beside.ground.cell_m), int(x / beside.ground.cell_m)
    assert 0.1 < beside.ground.gap_m[row, column] < 0.3
    assert inside.ground.gap_m[inside.ground.gap_m.shape[0] // 2, 0] > 5.0
