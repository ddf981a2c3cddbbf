"""Where a rover that is sent straight would come to stand, in evidence cells."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.mapping.arc_kernels import EvidenceArrays
from companion.mapping.reach_kernels import Stopping, first_to_stop_at, may_stop_at, moved_within_map

HEIGHT, WIDTH = 64, 48
STOPPING = Stopping(
    radius=2.0, map_radius=2.0, room=0.0, overshoot=1.0, rolling=0.0, held=0.0, unsure=0.0,
    flank=2.2, near=3.0, slack=0.2, edge=0.04,
)  # fmt: skip
START = (24.0, 10.0)


def seen(until_y: int = HEIGHT) -> EvidenceArrays:
    """Ground seen free up to a row."""
    log_odds = np.zeros((HEIGHT, WIDTH), dtype=np.float32)
    log_odds[:until_y] = -1.0
    fields = (HEIGHT // 4, WIDTH // 4)
    return EvidenceArrays(log_odds, np.zeros(fields), np.zeros(fields, dtype=np.float32), 4, 1.0, 0, 0)


@pytest.mark.parametrize(
    ("bearing_deg", "place"),
    [(0.0, (30.0, 63.96)), (180.0, (30.0, 0.04)), (90.0, (47.96, 40.0)), (-90.0, (0.04, 40.0))],
)
def test_a_place_ahead_lies_before_the_edge_of_the_map(bearing_deg: float, place: tuple[float, float]) -> None:
    bearing_rad = math.radians(bearing_deg)
    ahead = (math.sin(bearing_rad), math.cos(bearing_rad))
    assert moved_within_map(seen(), (30.0, 40.0), ahead, 99.0, 0.04) == pytest.approx(place)
    near = moved_within_map(seen(), (30.0, 40.0), ahead, 2.0, 0.04)
    assert near == pytest.approx((30.0 + 2.0 * ahead[0], 40.0 + 2.0 * ahead[1]))


def test_what_is_beyond_the_edge_already_stays_there() -> None:
    assert moved_within_map(seen(), (49.0, 5.0), (1.0, 0.0), 3.0, 0.04) == (49.0, 5.0)


def test_the_front_comes_to_stand_on_seen_ground_overshoot_included() -> None:
    # Radius 2 and overshoot 1 beyond the target; 0.2 is forgiven.
    assert may_stop_at(seen(40), START, (24.0, 37.0), STOPPING)
    assert not may_stop_at(seen(40), START, (24.0, 37.5), STOPPING)


def test_what_stands_or_ends_far_ahead_may_do_so_nearer_than_on_the_map() -> None:
    unsure = STOPPING._replace(unsure=0.8)
    assert may_stop_at(seen(40), START, (24.0, 36.3), unsure)
    assert not may_stop_at(seen(40), START, (24.0, 36.5), unsure)
    ground = seen()
    ground.log_odds[40, 24] = 3.0  # from 40 on: radius, overshoot and half a cell are kept from it
    assert may_stop_at(ground, START, (24.0, 36.4), STOPPING)
    assert not may_stop_at(ground, START, (24.0, 36.7), STOPPING)
    assert may_stop_at(ground, START, (24.0, 35.6), unsure)
    assert not may_stop_at(ground, START, (24.0, 35.9), unsure)


def test_an_obstacle_in_the_room_that_is_asked_for_refuses_it() -> None:
    ground = seen()
    ground.log_odds[25, 28] = 3.0
    assert may_stop_at(ground, START, (24.0, 40.0), STOPPING)
    assert not may_stop_at(ground, START, (24.0, 40.0), STOPPING._replace(room=3.0))


def test_an_unseen_place_beside_the_way_refuses_it() -> None:
    ground = seen()
    ground.log_odds[25, 21] = 0.0
    assert not may_stop_at(ground, START, (24.0, 40.0), STOPPING)
    assert may_stop_at(ground, START, (24.0, 20.0), STOPPING), "it ends before"


def test_so_does_an_unseen_strip_between_the_target_and_where_it_may_come_to_stand() -> None:
    ground, held = seen(), STOPPING._replace(held=12.0)
    assert may_stop_at(ground, START, (24.0, 30.0), held)
    ground.log_odds[31:42, 23:26] = 0.0
    assert not may_stop_at(ground, START, (24.0, 30.0), held)


def test_the_first_target_that_is_near_enough_is_taken() -> None:
    targets = np.array([[24.0, 60.0], [24.0, 45.0], [24.0, 36.0], [24.0, 20.0]])
    assert first_to_stop_at(seen(40), START, targets, 99.0, STOPPING) == 2
    assert first_to_stop_at(seen(40), START, targets, 20.0, STOPPING) == 3
    assert first_to_stop_at(seen(40), START, targets, 5.0, STOPPING) == -1
    assert first_to_stop_at(seen(), START, np.array([START]), 99.0, STOPPING) == -1, "where it stands already"


def test_a_rolling_rover_needs_more_ground_beyond_a_near_place() -> None:
    """Two and a half cells ahead: a tenth of that is seen beyond its front, what it rolls is not."""
    place, ground = (START[0], START[1] + 2.5), seen(15)
    assert may_stop_at(ground, START, place, STOPPING)
    assert not may_stop_at(ground, START, place, STOPPING._replace(rolling=1.0))
