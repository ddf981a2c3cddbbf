"""The search of arcs: it ends where it is to end, on arcs the rover can drive, over ground it may drive on."""

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.control.hybrid_astar import ArcLimits, GoalRegion, Poses, find
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_queries import ground_at
from companion.settings import MappingSettings

MIDDLE = 80.0
LIMITS = ArcLimits(
    sharpest=0.05, step=4.0, window=64, bin=2, room=4.0, tail=0.0, switch_cost=8.0, first_way=0, expansions=2000
)


def open_map() -> EvidenceMap:
    """20 x 20 m seen free."""
    evidence = new_map(empty_grid(20, 20), 0.35, MappingSettings())
    evidence.log_odds.fill(-1.0)
    return evidence


def goal(
    north: float, east: float, heading: float = 0.0, tolerance: float = math.pi, turned_cost: float = 0.0
) -> GoalRegion:
    """In cells from the middle."""
    return GoalRegion(MIDDLE + east, MIDDLE + north, heading, 3.0, tolerance, turned_cost)


def found(evidence: EvidenceMap, wanted: GoalRegion, heading: float = 0.0, **limits: float) -> Poses:
    ground = ground_at(evidence, Pose(10.0, 10.0, heading, 0.0))
    return find(ground, MIDDLE, MIDDLE, heading, wanted, LIMITS._replace(**limits))


def test_a_place_straight_ahead_is_reached_straight() -> None:
    way = found(open_map(), goal(32.0, 0.0))
    assert tuple(way[0]) == (MIDDLE, MIDDLE, 0.0, 0.0)
    assert (way[1:, 3] == 1.0).all() and np.allclose(way[:, 0], MIDDLE) and np.allclose(way[:, 2], 0.0)
    assert math.hypot(way[-1, 0] - MIDDLE, way[-1, 1] - MIDDLE - 32.0) <= 3.0


@pytest.mark.parametrize("bearing_deg", [0, 60, 120, 180, -100])
@pytest.mark.parametrize("first_way", [-1, 0, 1])
def test_the_way_is_of_arcs_that_can_be_driven_and_ends_in_the_region(bearing_deg: int, first_way: int) -> None:
    bearing = math.radians(bearing_deg)
    wanted = goal(36.0 * math.cos(bearing), 36.0 * math.sin(bearing), bearing, math.radians(25.0), 30.0)
    way = found(open_map(), wanted, first_way=first_way, expansions=20000)
    assert len(way) > 1
    turned = np.abs(np.diff(way[:, 2]))
    chords = np.hypot(*np.diff(way[:, :2], axis=0).T)
    assert (turned <= LIMITS.sharpest * LIMITS.step + 1e-9).all() and (chords <= LIMITS.step + 1e-9).all()
    assert first_way in (0, way[1, 3])
    assert math.hypot(way[-1, 0] - wanted.x, way[-1, 1] - wanted.y) <= wanted.tolerance
    aside = abs(math.remainder(way[-1, 2] - bearing, 2.0 * math.pi))
    assert min(aside, math.pi - aside) <= wanted.heading_tolerance


def test_a_costly_opposite_heading_is_not_taken_where_turning_round_is_cheaper() -> None:
    straight = math.radians(10.0)
    cheap = found(open_map(), goal(-30.0, 0.0, math.pi, straight, 0.0), expansions=20000)
    dear = found(open_map(), goal(-30.0, 0.0, math.pi, straight, 1000.0), expansions=20000)
    assert (cheap[1:, 3] == -1.0).all(), "straight back, tail first"
    assert abs(math.remainder(dear[-1, 2] - math.pi, 2.0 * math.pi)) <= straight


def test_it_goes_round_what_stands_and_keeps_its_room() -> None:
    evidence = open_map()
    evidence.log_odds[96:98, 70:92] = 2.0
    way = found(evidence, goal(40.0, 0.0), expansions=20000)
    assert len(way) > 1
    y, x = np.nonzero(evidence.log_odds > 0.0)
    gaps = np.hypot(x + 0.5 - way[:, None, 0], y + 0.5 - way[:, None, 1])
    assert gaps.min() > LIMITS.room - 0.5


@pytest.mark.parametrize(
    ("value", "expansions"), [(2.0, 20000), (-1.0, 1)], ids=["walled in", "given up after one pose"]
)
def test_no_way_is_no_rows(value: float, expansions: int) -> None:
    evidence = open_map()
    evidence.log_odds[70:92, 70:72] = evidence.log_odds[70:92, 90:92] = value
    evidence.log_odds[70:72, 70:92] = evidence.log_odds[90:92, 70:92] = value
    assert len(found(evidence, goal(30.0, 0.0), expansions=expansions)) == 0


def test_a_place_beyond_the_window_is_not_looked_for() -> None:
    assert len(found(open_map(), goal(70.0, 0.0))) == 0


def test_unseen_ground_is_entered_forwards_only() -> None:
    evidence = open_map()
    evidence.log_odds[:74] = 0.0
    behind = goal(-24.0, 0.0)
    assert len(found(evidence, behind, first_way=-1, sharpest=0.001)) == 0
    evidence.log_odds[86:] = 0.0
    assert len(found(evidence, goal(24.0, 0.0))) > 1


def test_a_closed_field_is_not_entered_but_left() -> None:
    evidence = open_map()
    here = evidence.base.cell_at(NedPoint(10.0, 10.0))
    evidence.base.weights[here.y, here.x] = 1.0
    assert len(found(evidence, goal(32.0, 0.0))) > 1, "the field that the rover stands in does not count"
    evidence.base.weights[here.y + 2, :] = 1.0
    assert len(found(evidence, goal(32.0, 0.0))) == 0


def test_backwards_the_tail_stays_on_seen_ground() -> None:
    evidence, back = open_map(), goal(-24.0, 0.0, 0.0, math.radians(25.0), 60.0)
    evidence.log_odds[: int(MIDDLE) - 26] = 0.0
    straight_back = {"first_way": -1, "sharpest": 0.001}
    assert len(found(evidence, back, tail=0.0, **straight_back)) > 1
    assert len(found(evidence, back, tail=6.0, **straight_back)) == 0
    assert len(found(evidence, back._replace(y=MIDDLE - 18.0), tail=6.0, **straight_back)) > 1


@pytest.mark.parametrize("offset", np.linspace(-1.0, 1.0, 9).tolist())
def test_backwards_not_even_a_corner_of_an_unseen_cell_is_cut(offset: float) -> None:
    """One unseen cell beside the way back, at any place of it: no point of the way found lies in it."""
    evidence = open_map()
    evidence.log_odds[62, 78] = 0.0
    heading = math.atan2(MIDDLE - 78.5 + offset, MIDDLE - 62.5)
    back = goal(-30.0 * math.cos(heading), -30.0 * math.sin(heading), heading, math.radians(25.0), 60.0)
    way = found(evidence, back, heading, first_way=-1, expansions=20000)
    assert len(way) > 1
    for start, end in pairwise(way):
        if end[3] > 0.0:
            continue
        shares = np.linspace(0.0, 1.0, 200)
        turned = start[2] + 0.5 * (end[2] - start[2])
        assert math.cos(turned - math.atan2(start[0] - end[0], start[1] - end[1])) > 0.99, "tail first"
        places = start[:2] + shares[:, None] * (end[:2] - start[:2])
        assert not ((np.floor(places) == (78, 62)).all(axis=1)).any()
