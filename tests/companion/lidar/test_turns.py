"""Points joined into turns."""

from __future__ import annotations

import numpy as np
import pytest

from companion.lidar.points import Points
from companion.lidar.turns import MOST_POINTS, Turn, TurnJoiner

STEP_S = 0.02


def points(first_deg: float, last_deg: float, step_deg: float = 1.0) -> Points:
    angle_deg = np.arange(first_deg, last_deg, step_deg) % 360.0
    return Points(angle_deg, np.full(len(angle_deg), 2.0), np.full(len(angle_deg), 100.0))


def turned(joiner: TurnJoiner, turns: float, hz: float = 10.0, begin_s: float = 0.0) -> list[Turn]:
    """As a lidar that turns evenly, from its zero on."""
    found, each_deg = [], 360.0 * hz * STEP_S
    for step in range(round(turns / (hz * STEP_S))):
        found += joiner.feed(points(step * each_deg, (step + 1) * each_deg), begin_s + (step + 1) * STEP_S)
    return found


@pytest.mark.parametrize("cut_deg", [0.0, 45.0, 300.5])
def test_each_turn_ends_at_the_cut_and_tells_when_each_point_was_taken(cut_deg: float) -> None:
    found = turned(TurnJoiner(cut_deg, 0.1), 5.0)
    assert len(found) == 4 if cut_deg else len(found) == 3
    for turn in found:
        assert len(turn.points) == 360
        since_deg = (turn.points.angle_deg - cut_deg) % 360.0
        assert np.all(np.diff(since_deg) > 0.0)
        # The lidar passes angle a of turn n at (n + a / 360) / 10 s.
        taken_s = turn.time_s - turn.age_s
        passes_s = np.round((taken_s - turn.points.angle_deg / 3600.0) * 10.0) / 10.0 + turn.points.angle_deg / 3600.0
        assert np.abs(taken_s - passes_s).max() < 0.002
        assert turn.age_s.min() >= 0.0 and turn.age_s.max() <= 0.1


def test_a_slower_lidar_is_noticed() -> None:
    turn = turned(TurnJoiner(0.0, 0.1), 12.0, hz=5.0)[-1]
    assert turn.age_s.max() == pytest.approx(0.2, abs=0.01)


def test_angles_that_waver_at_the_cut_make_no_turns_of_their_own() -> None:
    joiner, found = TurnJoiner(0.0, 0.1), []
    for number in range(6):
        wavering = Points(np.array([0.1, 359.9, 0.2, 359.8, 0.3]), np.ones(5), np.ones(5))
        found += joiner.feed(wavering, 0.1 * number + 0.001)
        found += joiner.feed(points(1.0, 359.0), 0.1 * number + 0.0995)
    assert len(found) == 5 and joiner.incomplete == 0
    assert all(355 <= len(turn.points) <= 365 for turn in found)


def test_a_turn_with_a_large_gap_is_none_and_one_with_a_small_gap_is() -> None:
    for gap_deg, whole in ((120.0, False), (60.0, True)):
        joiner = TurnJoiner(0.0, 0.1)
        joiner.feed(points(180.0, 360.0), 0.05)
        joiner.feed(points(0.0, 100.0), 0.1)
        joiner.feed(points(100.0 + gap_deg, 360.0), 0.15)
        assert bool(joiner.feed(points(0.0, 1.0), 0.1501)) is whole
        assert joiner.incomplete == (0 if whole else 1)


def test_a_lidar_that_stands_gives_no_turns_and_keeps_nothing() -> None:
    joiner = TurnJoiner(0.0, 0.1)
    one = Points(np.full(100, 30.0), np.ones(100), np.ones(100))
    assert [turn for step in range(200) for turn in joiner.feed(one, 0.02 * step)] == []
    assert joiner._count <= MOST_POINTS
    assert len(turned(joiner, 4.0, begin_s=10.0)) >= 2


def test_a_turn_that_takes_too_long_is_none() -> None:
    joiner = TurnJoiner(0.0, 0.1)
    joiner.feed(points(180.0, 360.0), 0.0)
    joiner.feed(points(0.0, 360.0), 0.1)
    assert joiner.feed(points(0.0, 1.0), 2.0) == []


def test_nothing_of_before_a_cut_cable_is_joined_to_what_comes_after() -> None:
    joiner = TurnJoiner(0.0, 0.1)
    turned(joiner, 1.5)
    joiner.forget()
    assert joiner.feed(points(180.0, 360.0), 1.0) == []
    assert joiner.feed(points(0.0, 1.0), 1.0) == []
