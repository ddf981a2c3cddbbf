"""Times to a goal by fast marching: round fronts, walls, and paces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.mapping.cost_to_go import cost_to_go


def goal(x: int, y: int) -> np.ndarray:
    return np.array([[x, y]])


def test_fronts_are_round() -> None:
    times = cost_to_go(np.full((81, 81), 1.0), goal(40, 40))
    y, x = np.mgrid[0:81, 0:81]
    true = np.hypot(x - 40, y - 40)
    far = true > 10
    assert (np.abs(times - true)[far] / true[far]).max() < 0.08, "a diamond or an octagon would be off by 8 % or more"
    assert times[40, 40] == 0.0


def test_a_wall_is_gone_round_and_what_it_shuts_in_has_no_way() -> None:
    pace = np.full((20, 20), 1.0)
    pace[:15, 10] = np.inf
    times = cost_to_go(pace, goal(5, 2))
    assert times[2, 15] > 25.0 > times[2, 9]
    pace[15:, 10] = np.inf
    times = cost_to_go(pace, goal(5, 2))
    assert np.isinf(times[:, 10:]).all() and np.isfinite(times[:, :10]).all()


def test_ground_of_half_the_speed_takes_twice_as_long() -> None:
    pace = np.full((9, 60), 1.0)
    once = cost_to_go(pace, goal(0, 4))[4, 50]
    assert cost_to_go(2.0 * pace, goal(0, 4))[4, 50] == pytest.approx(2.0 * once)


Paces = arrays(np.float64, (9, 11), elements=st.sampled_from([0.5, 1.0, 3.0, np.inf]))


@given(Paces, st.integers(0, 10), st.integers(0, 8))
def test_times_grow_from_the_goal_by_no_more_than_a_cells_pace(pace: np.ndarray, x: int, y: int) -> None:
    times = cost_to_go(pace, goal(x, y))
    for row in range(9):
        for column in range(11):
            if (row, column) == (y, x) or np.isinf(times[row, column]):
                continue
            near = [
                times[r, c]
                for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
                if 0 <= r < 9 and 0 <= c < 11
            ]
            assert min(near) < times[row, column] <= min(near) + pace[row, column] + 1e-9


def test_a_goal_off_the_raster_leads_nowhere() -> None:
    assert np.isinf(cost_to_go(np.full((4, 4), 1.0), goal(9, 9))).all()
