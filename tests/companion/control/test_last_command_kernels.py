"""When a command may be the last."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.control.last_command_kernels import admitted_speeds, may_be_last, spare_m
from companion.control.motion_kernels import (
    AS_AT_EDGE,
    BLOCKED_S,
    MotionProblem,
    Start,
    clearance_m,
    cost_s,
    discs_clear_m,
    moved,
)
from tests.companion.control.test_motion_kernels import BODY, CELL_M, MODEL, SIDE, STANDING, constant, problem


def among(posts: list[tuple[int, int]], start: Start, unseen_from: int) -> MotionProblem:
    """Ground with posts, each named by its first row and column. Its edges are unseen, as in every window."""
    walls = [(row, row + 3, column, column + 2) for row, column in posts]
    made = problem(*walls, start=start, unseen_from=unseen_from)
    cells = np.minimum(np.arange(SIDE), np.arange(SIDE)[::-1])
    edge_m = CELL_M * (np.minimum(cells[:, None], cells) - 0.5)
    seen_m = np.minimum(made.ground.seen_m, edge_m.astype(np.float32))
    return made._replace(ground=made.ground._replace(seen_m=seen_m))


@pytest.mark.parametrize("margin_m", [0.0, 0.05])
def test_a_rover_that_is_too_near_already_may_get_away_but_come_no_nearer(margin_m: float) -> None:
    ground = problem((23, 25, 0, SIDE))  # 5 cm before its front
    assert cost_s(constant(-0.3), ground) < BLOCKED_S < cost_s(constant(0.3), ground)
    assert may_be_last(-0.3, 0.0, 0.3, (1.0,), margin_m, 0.0, ground) and not may_be_last(
        0.5, 0.0, 0.3, (1.0,), margin_m, 0.0, ground
    )


def test_a_fast_rover_that_is_left_alone_keeps_more_room() -> None:
    beside, rolling = (25, 45, 54, 56), Start(5.0, 2.0, 0.0, 1.5, 0.0)
    assert may_be_last(1.5, 0.0, 0.3, (1.0,), 0.0, 0.0, problem(beside, start=rolling))
    assert not may_be_last(1.5, 0.0, 0.3, (1.0,), 0.0, 0.2, problem(beside, start=rolling))


def test_so_does_one_that_backs() -> None:
    beside = problem((40, 46, 54, 56), start=Start(5.0, 5.5, 0.0, -0.5, 0.0))
    for margin_s, may in ((0.0, True), (0.2, True), (0.8, False)):
        assert may_be_last(-0.5, 0.0, 3.0, (1.0,), 0.0, margin_s, beside) is may


def test_ground_that_was_not_seen_beside_it_does_not_let_it_touch_what_was() -> None:
    """A rover whose side stands over unseen ground may go on over such ground, but into nothing."""
    started = Start(5.0, 2.0, 0.0, 0.0, 0.0)
    unseen = problem((35, 37, 0, SIDE), start=started, unseen_from=21)
    assert not may_be_last(1.5, 0.0, 1.0, (1.0,), 0.0, 0.0, unseen)


def test_a_command_may_be_the_last_if_the_way_it_leads_to_a_stop_is_free_and_seen() -> None:
    rolling = Start(5.0, 2.0, 0.0, 1.0, 0.0)
    # 0.2 s pending, which brakes; 0.3 s held; then 1 m/s² down: 1.1 m and the front.
    for unseen_from, may in ((36, True), (31, False)):
        assert may_be_last(1.0, 0.0, 0.3, (1.0,), 0.0, 0.0, problem(start=rolling, unseen_from=unseen_from)) is may
    assert not may_be_last(1.0, 0.0, 3.0, (1.0,), 0.0, 0.0, problem(start=rolling, unseen_from=36))
    turns = problem((20, 40, 57, 59), start=rolling)
    assert may_be_last(1.0, 0.5, 0.5, (1.0,), 0.0, 0.0, turns) and not may_be_last(
        1.0, 0.5, 3.0, (1.0,), 0.0, 0.0, turns
    )


def test_a_rover_that_hardly_brakes_may_not_be_left_alone_and_that_is_found_soon() -> None:
    rolling = problem(start=Start(5.0, 5.0, 0.0, 1.0, 0.0))
    assert may_be_last(1.0, 3.0, 0.3, (1.0,), 0.0, 0.0, rolling)
    assert not may_be_last(1.0, 3.0, 0.3, (1.0,), 0.0, 0.0, rolling._replace(model=MODEL._replace(decel_m_s2=1e-9)))


def test_less_is_admitted_towards_a_wall_and_the_less_the_longer_it_lasts() -> None:
    """Straight on, to the left and to the right; a wall 2 m ahead, which a turn does not meet."""
    turns, gains = np.array((-1.5, 0.0, 1.5)), (1.0, 0.9, 1.1)
    shorter, longer = (
        admitted_speeds(turns, lasts_s, gains, 0.03, 0.05, problem((40, 42, 0, SIDE))) for lasts_s in (0.3, 3.0)
    )
    free = admitted_speeds(turns, 0.3, gains, 0.03, 0.05, problem())
    assert free[1, 0] == MODEL.fastest_m_s and shorter[1, 0] <= free[1, 0]
    assert 0.0 < longer[1, 0] < 0.6 < shorter[1, 0]
    for told_m_s in (shorter[1, 0], longer[1, 0]):
        lasts_s = 0.3 if told_m_s == shorter[1, 0] else 3.0
        assert may_be_last(told_m_s, 0.0, lasts_s, (1.0,), 0.03, 0.05, problem((40, 42, 0, SIDE)))
    faster_m_s = 1.08 * longer[1, 0]
    assert not may_be_last(faster_m_s, 0.0, 3.0, (1.0,), 0.03, 0.05, problem((40, 42, 0, SIDE))), "little is lost"


def test_a_rover_that_touches_something_may_leave_it_but_not_touch_the_next_thing() -> None:
    """It stands 5 cm over a wall behind it; 3 m ahead there is another one."""
    start = STANDING._replace(y_m=2.0 + BODY.around_m - 0.05)
    behind, ahead, both = (
        problem(*walls, start=start)
        for walls in ([(19, 20, 0, SIDE)], [(50, 52, 0, SIDE)], [(19, 20, 0, SIDE), (50, 52, 0, SIDE)])
    )
    room_m = clearance_m(both.ground.gap_m, CELL_M, BODY, start.x_m, start.y_m, start.heading_rad)
    assert -0.1 < room_m < -0.02
    speeds_m_s = np.arange(0.05, 1.5, 0.01)
    assert all(may_be_last(speed, 0.0, 3.0, (1.0,), 0.03, 0.05, behind) for speed in speeds_m_s)
    passed = [speed for speed in speeds_m_s if may_be_last(speed, 0.0, 3.0, (1.0,), 0.03, 0.05, both)]
    assert 0.3 < max(passed) < 1.0
    assert all(may_be_last(speed, 0.0, 3.0, (1.0,), 0.0, 0.0, ahead) for speed in passed)


@given(
    st.lists(st.tuples(st.integers(0, 95), st.integers(0, 95)), min_size=1, max_size=12),
    st.integers(40, SIDE),
    st.floats(-0.5, 2.0),
    st.floats(-1.5, 1.5),
    st.floats(-0.5, 2.0),
    st.floats(0.0, 0.2),
)
def test_where_there_is_surely_room_no_look_is_needed(
    posts: list[tuple[int, int]], unseen_from: int, told_m_s: float, turn_rad_s: float, now_m_s: float, margin_s: float
) -> None:
    ground = among(posts, Start(5.0, 2.0, 0.3, now_m_s, 0.5 * turn_rad_s), unseen_from)
    exact_m = spare_m(told_m_s, turn_rad_s, 2.0, (1.3,), 0.03, margin_s, ground)
    assert may_be_last(told_m_s, turn_rad_s, 2.0, (1.3,), 0.03, margin_s, ground) is (exact_m >= 0.0)
    enough_m = spare_m(told_m_s, turn_rad_s, 2.0, (1.3,), 0.03, margin_s, ground, -math.inf, 0.1)
    assert enough_m == min(exact_m, 0.1)


@given(
    st.lists(st.tuples(st.integers(30, 95), st.integers(0, 95)), min_size=1, max_size=12),
    st.integers(40, SIDE),
    st.floats(-0.5, 2.0),
    st.floats(-1.5, 1.5),
    st.floats(-0.5, 2.0),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([(1.0,), (1.3, 0.6, 1.0)]),
)
def test_what_is_spared_is_what_the_model_says_step_by_step(
    posts: list[tuple[int, int]],
    unseen_from: int,
    told_m_s: float,
    turn_rad_s: float,
    now_m_s: float,
    turns_already: float,
    gains: tuple[float, ...],
) -> None:
    """Two steps of what was told before, twenty of the command, then to a stop; over ground that is not seen, too."""
    start = Start(5.0, 2.0, 0.3, now_m_s, turns_already * turn_rad_s)
    told = among(posts, start, unseen_from)._replace(pending=np.array([[0.7, 0.0], [0.2, 0.9]]))
    expected_m, ground = 10.0, told.ground
    for gain in gains:
        state, step = tuple(start), 0
        while step < 22 or abs(state[3]) > 0.02 or abs(state[4]) > 0.02:
            now = told.pending[step] if step < 2 else (told_m_s, turn_rad_s) if step < 22 else (0.0, 0.0)
            state, step = moved(state, now[0], gain * now[1], MODEL, 0.1), step + 1
            clear_m = discs_clear_m(ground.gap_m, CELL_M, BODY, *_turned(state), AS_AT_EDGE)
            seen_m = discs_clear_m(ground.seen_m, CELL_M, BODY, *_turned(state), 0.0)
            expected_m = min(expected_m, clear_m - 0.03 - 0.1 * abs(state[3]), seen_m - 0.03)
    assert spare_m(told_m_s, turn_rad_s, 2.0, gains, 0.03, 0.1, told) == pytest.approx(expected_m, abs=1e-9)


@given(
    st.lists(st.tuples(st.integers(24, 60), st.integers(30, 70)), min_size=1, max_size=12),
    st.floats(-0.5, 2.0),
    st.floats(0.0, 0.3),
)
def test_what_is_admitted_may_be_told_whichever_way_the_rover_turns(
    posts: list[tuple[int, int]], now_m_s: float, margin_s: float
) -> None:
    ground, gains = among(posts, Start(5.0, 2.0, 0.1, now_m_s, 0.0), SIDE), (1.3, 0.6, 1.0)
    turns_rad_s = np.array((-1.0, -0.3, 0.0, 0.3, 1.0))
    for turn_rad_s, most in zip(
        turns_rad_s, admitted_speeds(turns_rad_s, 1.0, gains, 0.03, margin_s, ground), strict=True
    ):
        for told_m_s in (most[0], -most[1]):
            assert told_m_s == 0.0 or all(
                may_be_last(told_m_s, turn_rad_s, 1.0, (gain,), 0.03, margin_s, ground) for gain in gains
            )


def test_unseen_ground_beside_it_does_not_let_it_come_nearer_to_what_stands() -> None:
    """The rover's side is 5 cm from unseen ground; it must keep 0.2 m from a wall ahead."""
    start = STANDING._replace(y_m=2.0)
    made = problem((40, 42, 0, SIDE), start=start)
    seen_m = np.minimum(made.ground.seen_m, (CELL_M * np.arange(SIDE) - start.x_m + BODY.radius_m + 0.1)[None, ::1])
    told = made._replace(ground=made.ground._replace(seen_m=seen_m.astype(np.float32)))
    beside_m = discs_clear_m(told.ground.seen_m, CELL_M, BODY, start.x_m, start.y_m, 0.0, 1.0, 0.0)
    assert 0.0 < beside_m < 0.1
    passed = [speed for speed in np.arange(0.05, 1.5, 0.01) if may_be_last(speed, 0.0, 3.0, (1.0,), 0.2, 0.0, told)]
    free = [speed for speed in np.arange(0.05, 1.5, 0.01) if may_be_last(speed, 0.0, 3.0, (1.0,), 0.2, 0.0, made)]
    assert 0.1 < max(passed) == max(free) < 1.0


def _turned(state: tuple[float, ...]) -> tuple[float, float, float, float]:
    """Its place, and sine and cosine of its heading."""
    return state[0], state[1], math.sin(state[2]), math.cos(state[2])


def test_beside_a_long_rover_there_is_the_room_of_its_flank_however_much_it_must_keep() -> None:
    """At 2 m/s it comes between walls that its flanks keep 1.15 m from, and its circle 0.55 m."""
    long, rolling = BODY._replace(ahead_m=np.linspace(-0.6, 0.6, 7), around_m=0.85), Start(5.0, 2.0, 0.0, 2.0, 0.0)
    walls = ((31, SIDE, 34, 36), (31, SIDE, 64, 66))
    between = problem(*walls, start=rolling)._replace(body=long, pending=np.empty((0, 2)))
    room_m = discs_clear_m(between.ground.gap_m, CELL_M, long, 5.0, 4.0, 0.0, 1.0, AS_AT_EDGE)
    assert 1.1 < room_m < 1.2
    for margin_s, may in ((0.5, True), (0.7, False)):
        assert may_be_last(2.0, 0.0, 2.0, (1.0,), 0.03, margin_s, between) is may
    admitted_m_s = admitted_speeds(np.zeros(1), 2.0, (1.0,), 0.03, 0.5, between)
    assert admitted_m_s[0, 0] == MODEL.fastest_m_s


@pytest.mark.parametrize(
    ("now_m_s", "before_m_s", "turn_rad_s"), [(0.0, 2.0, 0.0), (0.0, 2.0, 1.5), (0.0, 0.0, 1.5), (2.0, 0.0, 0.0)]
)
def test_no_look_is_left_out_where_a_long_rover_turns_or_is_faster_than_told(
    now_m_s: float, before_m_s: float, turn_rad_s: float
) -> None:
    """Told to stand, it first does what it was told before; walls ahead and beside it and a post, at every distance."""
    long = BODY._replace(ahead_m=np.array([-0.6, -0.2, 0.2, 0.6]), around_m=0.85)
    for near in range(4, 30):
        post = (20 + near, 22 + near, 58, 60)
        for wall in ((20 + near, 22 + near, 0, SIDE), (0, SIDE, 50 + near, 52 + near), post):
            told = problem(wall, start=STANDING._replace(speed_m_s=now_m_s))._replace(
                body=long, pending=np.tile((before_m_s, turn_rad_s), (12, 1))
            )
            for margin_s in (0.0, 0.3):
                given = (0.0, turn_rad_s, 1.0, (1.0,), 0.03, margin_s, told)
                exact_m = spare_m(*given)
                assert may_be_last(*given) is (exact_m >= 0.0), (near, wall, margin_s)
                enough_m = spare_m(*given, -math.inf, 0.1)
                assert enough_m == min(exact_m, 0.1), (near, wall, margin_s)


def test_a_rover_that_gathers_speed_before_the_command_is_followed_until_it_stands() -> None:
    """At 2 m/s it needs 4 m and 40 steps, though it is told to stand and stands now."""
    slow_to_stop = MODEL._replace(accel_m_s2=20.0, decel_m_s2=0.5)
    told = problem()._replace(model=slow_to_stop, pending=np.tile((2.0, 0.0), (4, 1)))
    assert may_be_last(0.0, 0.0, 0.3, (1.0,), 0.03, 0.05, told)
    wall = problem((62, 64, 0, SIDE))._replace(model=slow_to_stop, pending=told.pending)
    assert not may_be_last(0.0, 0.0, 0.3, (1.0,), 0.03, 0.05, wall)


def test_a_rover_that_turns_more_than_told_is_followed_until_it_turns_no_more() -> None:
    """At 3 rad/s instead of 1.5 that takes 10 s, not 5 s."""
    slow_to_turn = problem()._replace(model=MODEL._replace(turn_accel_rad_s2=0.3))
    assert may_be_last(0.0, 1.5, 12.0, (2.0,), 0.03, 0.05, slow_to_turn)


def test_the_fastest_speed_that_may_be_told_is_found_to_a_fine_step() -> None:
    found = set()
    for row in range(28, 60):
        ground = problem((row, row + 2, 0, SIDE))
        (speed_m_s, _), *_ = admitted_speeds(np.array([0.0]), 3.0, (1.0,), 0.03, 0.05, ground)
        if 0.0 < speed_m_s < MODEL.fastest_m_s:
            found.add(float(speed_m_s))
            faster_m_s = MODEL.fastest_m_s * (math.sqrt(speed_m_s / MODEL.fastest_m_s) + 1.0 / 80.0) ** 2
            assert may_be_last(speed_m_s, 0.0, 3.0, (1.0,), 0.03, 0.05, ground)
            assert not may_be_last(faster_m_s, 0.0, 3.0, (1.0,), 0.03, 0.05, ground), row
    assert len(found) > 10
