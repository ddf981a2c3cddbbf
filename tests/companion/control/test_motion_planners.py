"""Motion planners on the same problems."""

from __future__ import annotations

import numpy as np
import pytest

from companion.control.motion_kernels import BLOCKED_S, Start, cost_s
from companion.control.motion_planners import MOTION_PLANNERS, constant_motions, motion_planner
from tests.companion.control.test_motion_kernels import MODEL, problem

GAP = ((40, 42, 0, 62), (40, 42, 71, 100))
"""A wall with a gap of 0.9 m, 1.65 m to the right of straight ahead."""


@pytest.mark.parametrize("kind", list(MOTION_PLANNERS))
def test_each_finds_a_way_on_and_none_into_a_wall(kind: str) -> None:
    for walls in ((), GAP):
        planner, ground = motion_planner(kind, 3), problem(*walls)
        for _ in range(10):
            motion, found_s, judged, costs = planner.plan(ground, 0.0)
        assert costs == pytest.approx([cost_s(one, ground) for one in judged])
        assert found_s == pytest.approx(cost_s(motion, ground))
        assert found_s < cost_s(np.zeros((6, 2)), ground) <= BLOCKED_S


def test_the_genetic_algorithm_is_nearest_to_the_best_through_a_gap() -> None:
    """Over 20 seeds, after ten ticks standing: never dearer than the dynamic window, cheaper on average than either."""
    ground = problem(*GAP, start=Start(5.0, 2.0, 0.0, 1.0, 0.0))
    costs: dict[str, list[float]] = {kind: [] for kind in MOTION_PLANNERS}
    for seed in range(20):
        for kind, found in costs.items():
            planner = motion_planner(kind, seed)
            for _ in range(10):
                found_s = planner.plan(ground, 0.0).cost_s
            found.append(found_s)
    ga, dwa, mppi = (np.array(costs[kind]) for kind in ("motion-ga", "dwa", "mppi"))
    assert (ga <= dwa + 1e-9).all() and ga.mean() < dwa.mean() - 0.1 and ga.mean() <= mppi.mean()


@pytest.mark.parametrize("kind", list(MOTION_PLANNERS))
def test_a_seed_gives_the_same_motions(kind: str) -> None:
    motions = []
    for _ in range(2):
        planner = motion_planner(kind, 7)
        motions.append([planner.plan(problem(*GAP), 0.05)[0] for _ in range(4)])
    assert np.array_equal(motions[0], motions[1])


def test_what_was_found_before_helps() -> None:
    ground, planner = problem(*GAP), motion_planner("motion-ga", 1)
    first_s = planner.plan(ground, 0.0)[1]
    for _ in range(15):
        later_s = planner.plan(ground, 0.0)[1]
    assert later_s < first_s
    planner.forget()
    assert planner.plan(ground, 0.0)[1] > later_s


def test_constant_motions_have_standing_and_turning_among_them() -> None:
    first = constant_motions(MODEL)[:, 0]
    assert [0.0, 0.0] in first.tolist() and [0.0, 1.5] in first.tolist() and [2.0, 0.0] in first.tolist()
