"""What motions cost."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.control.motion_controller import WEIGHTS as DRIVEN_WITH
from companion.control.motion_kernels import (
    AS_AT_EDGE,
    BLOCKED_S,
    Body,
    MotionGround,
    MotionProblem,
    RoverModel,
    Start,
    Weights,
    at_place,
    begin_later,
    clearance_m,
    cost_s,
    keep_within,
    least_allowed_m,
    moved,
    next_generation,
    told_at,
)
from companion.mapping.cost_to_go import cost_to_go
from companion.mapping.distance_field import distance_field

CELL_M = 0.1
SIDE = 100
MODEL = RoverModel(0.2, 1.0, 1.0, 2.0, 2.0, 0.5, 1.5, 1.0)
BODY = Body(np.array([-0.1, 0.1]), 0.25, 0.35)
ALL_ADMITTED = np.tile((2.0, 0.5), (3, 1))
STANDING = Start(5.0, 2.0, 0.0, 0.0, 0.0)
WEIGHTS = Weights(0.03, 0.02, 4.0, 0.25, 1.0, 0.3, 0.5, 0.0, 0.0, 2.0)


def problem(
    *walls: tuple[int, int, int, int], start: Start = STANDING, unseen_from: int = SIDE, ends: bool = False
) -> MotionProblem:
    """10 x 10 m, north is up; ``walls``: first and last row, first and last column. The goal lies 8.5 m north."""
    blocked = np.zeros((SIDE, SIDE), dtype=np.bool_)
    for low, high, left, right in walls:
        blocked[low:high, left:right] = True
    unseen = np.zeros_like(blocked)
    unseen[unseen_from:] = True
    gap_m = distance_field(blocked) * np.float32(CELL_M) - np.float32(0.5 * CELL_M)
    seen_m = distance_field(blocked | unseen) * np.float32(CELL_M) - np.float32(0.5 * CELL_M)
    pace = np.where(gap_m > BODY.radius_m, CELL_M / MODEL.fastest_m_s, np.inf)
    ground = MotionGround(gap_m, seen_m, CELL_M, cost_to_go(pace, np.array([[50, 85]])), CELL_M, ends)
    return MotionProblem(start, np.zeros((2, 2)), ground, BODY, MODEL, WEIGHTS, ALL_ADMITTED, 2.5, 0.1)


def constant(speed_m_s: float, turn_rad_s: float = 0.0) -> np.ndarray:
    return np.tile((speed_m_s, turn_rad_s), (6, 1)).astype(np.float64)


def test_getting_on_is_cheaper_than_standing_and_standing_than_going_back() -> None:
    ground = problem()
    ahead, stands, back = (cost_s(constant(speed), ground) for speed in (2.0, 0.0, -0.5))
    assert ahead < stands < back < BLOCKED_S
    # 6.5 m at 2 m/s, the time to gather speed, and the dead time.
    assert ahead == pytest.approx(3.25 + 1.0 + 0.2, abs=0.3)


def test_what_touches_something_is_blocked_and_the_earlier_the_dearer() -> None:
    far, near = problem((50, 52, 0, SIDE)), problem((35, 37, 0, SIDE))
    assert BLOCKED_S < cost_s(constant(2.0), far) < cost_s(constant(2.0), near)
    assert cost_s(constant(0.0), near) < BLOCKED_S


def test_a_motion_that_could_not_brake_at_its_end_is_blocked() -> None:
    slow, fast = constant(1.0), constant(1.0)
    fast[-1, 0] = 2.0
    ground = problem((51, 53, 0, SIDE))
    assert cost_s(slow, ground) < BLOCKED_S <= cost_s(fast, ground)
    # From 2 m/s it needs 2 m: a thin post anywhere on that way is in it.
    rolling = Start(5.0, 1.0, 0.0, 2.0, 0.0)
    for row in range(69, 80, 2):
        post = problem((row, row + 1, 50, 51), start=rolling)
        body = BODY._replace(ahead_m=np.array([0.0]), radius_m=0.2, around_m=0.2)
        assert cost_s(constant(2.0), post._replace(body=body, pending=np.full((2, 2), (2.0, 0.0)))) >= BLOCKED_S, row


@pytest.mark.parametrize(
    ("now_m", "least_m"), [(0.5, 0.49), (0.0, -0.01), (-0.02, -0.03), (-0.035, -0.04), (-0.04, -0.04), (-0.2, -0.2)]
)
def test_a_rover_that_is_too_near_may_come_a_little_nearer_but_never_far(now_m: float, least_m: float) -> None:
    assert least_allowed_m(now_m) == pytest.approx(least_m)


def test_a_rover_over_unseen_ground_may_touch_what_stands_no_more_than_over_seen() -> None:
    wall = (35, 37, 0, SIDE)
    seen, unseen = problem(wall), problem(wall, unseen_from=21)
    free = [
        [cost_s(constant(speed), one) < BLOCKED_S for speed in np.arange(0.05, 1.0, 0.01)] for one in (seen, unseen)
    ]
    assert free[0] == free[1] and any(free[0]) and not all(free[0])


def test_what_can_be_done_now_is_not_put_off() -> None:
    """To go a little and wait there, or to wait and then go: both end at nearly the same place."""
    now, later = constant(0.0), constant(0.0)
    now[:3, 0], later[3:5, 0] = 0.3, 0.3
    as_near, sooner = problem(), problem()._replace(weights=WEIGHTS._replace(late=0.4))
    assert cost_s(later, as_near) == pytest.approx(cost_s(now, as_near), abs=0.1)
    assert cost_s(now, sooner) < cost_s(later, sooner)


def test_narrow_and_unseen_ground_cost_more() -> None:
    free = cost_s(constant(1.0), problem())
    assert free < cost_s(constant(1.0), problem((25, 45, 54, 56))) < BLOCKED_S
    assert free < cost_s(constant(1.0), problem(unseen_from=30))


def test_a_rover_too_fast_to_stop_at_the_end_of_its_path_costs_more_and_one_that_passes_through_does_not() -> None:
    near_end = Start(5.0, 6.5, 0.0, 1.9, 0.0)
    fast, braking = constant(1.9), constant(0.6)
    assert cost_s(braking, problem(start=near_end, ends=True)) < cost_s(fast, problem(start=near_end, ends=True))
    assert cost_s(fast, problem(start=near_end)) < cost_s(braking, problem(start=near_end))


def test_what_passes_nearly_touching_costs_more_the_faster_it_does() -> None:
    beside = problem((25, 45, 54, 56))
    dearer = [cost_s(constant(speed_m_s), beside) - cost_s(constant(speed_m_s), problem()) for speed_m_s in (0.5, 1.5)]
    assert 0.0 < dearer[0] < dearer[1] < BLOCKED_S


def test_the_model_follows_with_limited_changes() -> None:
    state = (0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(10):
        state = moved(state, 2.0, 1.0, MODEL, 0.1)
    assert state[3] == pytest.approx(1.0) and state[4] == pytest.approx(1.0)
    assert state[2] == pytest.approx(0.75), "half a second to 1 rad/s, then half a second of it"
    assert 0.3 < math.hypot(state[0], state[1]) < 0.55


def test_knots_are_joined_by_straight_lines_and_begun_later() -> None:
    motion = np.column_stack((np.arange(6.0), np.zeros(6)))
    assert told_at(motion, 0.5)[0] == pytest.approx(2.5) and told_at(motion, 1.7)[0] == 5.0
    motions = motion[None].copy()
    begin_later(motions, 0.1)
    assert motions[0, :, 0] == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5, 5.0])


def test_rasters_are_read_between_cells() -> None:
    raster = np.array([[0.0, 1.0], [2.0, 3.0]])
    assert at_place(raster, 1.0, 1.0, 1.0, -1.0) == 1.5 and at_place(raster, 1.0, 0.6, 0.5, -1.0) == pytest.approx(0.1)
    assert at_place(raster, 1.0, 5.0, 0.5, -1.0) == -1.0
    assert at_place(raster, 1.0, 5.0, 0.5, AS_AT_EDGE) == pytest.approx(1.0, abs=0.01)
    wall = problem((60, 62, 0, SIDE)).ground
    # The wall's near side lies 6 m north; the front disc reaches 0.35 m ahead.
    assert clearance_m(wall.gap_m, CELL_M, BODY, 5.0, 5.3, 0.0) == pytest.approx(0.35, abs=0.03)
    assert clearance_m(wall.gap_m, CELL_M, BODY, 5.0, 5.3, 0.5 * math.pi) == pytest.approx(0.45, abs=0.03)
    # With more room than matters it is that of the circle round the outline.
    assert clearance_m(wall.gap_m, CELL_M, BODY, 5.0, 4.0, 0.5 * math.pi) == pytest.approx(1.65, abs=0.03)


def test_a_generation_keeps_its_best_and_stays_within_limits() -> None:
    rng, ground = np.random.default_rng(0), problem((40, 42, 20, 60))
    motions = rng.standard_normal((32, 6, 2))
    costs = np.array([cost_s(motion, ground) for motion in motions])
    bests = [costs.min()]
    for _ in range(12):
        next_generation(
            motions, costs, 8, rng.random((32, 10)), rng.standard_normal((32, 6, 2)), np.array([0.5, 0.8]), ground
        )
        assert costs == pytest.approx([cost_s(motion, ground) for motion in motions])
        bests.append(costs.min())
    assert all(b <= a for a, b in pairwise(bests)) and bests[-1] < bests[0] - 0.3
    assert motions[8:, :, 0].max() <= 2.0 and motions[8:, :, 0].min() >= -0.5
    assert np.abs(motions[8:, :, 1]).max() <= 1.5


def test_no_motion_begins_faster_than_is_admitted_at_its_turn_rate() -> None:
    admitted = np.array(((0.5, 0.1), (2.0, 0.5), (1.0, 0.2)))
    for turn_rad_s, fastest, backwards in ((-1.5, 0.5, 0.1), (0.2, 2.0, 0.5), (1.4, 1.0, 0.2)):
        for told_m_s, kept_m_s in ((9.0, fastest), (-9.0, -backwards), (0.05, 0.05)):
            motion = constant(told_m_s, turn_rad_s)
            keep_within(motion, problem()._replace(admitted_m_s=admitted))
            assert motion[0, 0] == kept_m_s and abs(motion[1, 0]) <= 2.0


def test_a_child_begins_as_one_parent_and_ends_as_another() -> None:
    """Nothing mutates: the knots before the cut are the mother's, the others the father's."""
    motions = np.array([constant(0.2 * one, 0.1 * one) for one in range(6)])
    ground = problem()
    costs = np.array([cost_s(one, ground) for one in motions])
    chances = np.ones((6, 10))
    chances[:, :3] = 0.0, 0.99, 0.5
    next_generation(motions, costs, 2, chances, np.zeros((6, 6, 2)), np.array([0.5, 0.8]), ground)
    mother, father = motions[:2]
    assert not np.array_equal(mother, father)
    for child in motions[2:]:
        assert np.array_equal(child[:3], mother[:3]) and np.array_equal(child[3:], father[3:])


def test_a_wall_nearby_is_a_risk_with_the_weights_that_are_driven_with() -> None:
    """It stands 0.25 m beside the rover: nearer than 0.4 m, farther than what must be kept. One in the open is none."""

    def risk_s(wall: tuple[int, int, int, int]) -> float:
        with_it = problem(wall)._replace(weights=DRIVEN_WITH)
        without = with_it._replace(weights=DRIVEN_WITH._replace(risk=0.0))
        return cost_s(constant(1.0), with_it) - cost_s(constant(1.0), without)

    assert risk_s((25, 45, 55, 57)) > 0.1 and risk_s((25, 45, 60, 62)) == 0.0
