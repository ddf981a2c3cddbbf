"""The least time of a mission: known for an open field and for a wall with a gap, and no drive is faster."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sitl.campaign.drive_run import mission_of
from sitl.campaign.run_spec import RunSpec
from sitl.experiments.time_bound import ways_m
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import made
from sitl.plant.outline import Outline
from sitl.scenario import SOMEWHERE, Scenario, scenario_from_mission
from sitl.world.truth import SimStart
from sitl.world.world import World


def way_m(where: Scenario, places: list[tuple[float, float]]) -> float | None:
    legs_m = ways_m(where, places)
    return None if legs_m is None else math.fsum(legs_m)


def scenario(solid: np.ndarray, side_m: float) -> Scenario:
    return Scenario(World(solid, side_m), SimStart(5.0, 5.0, 0.0, SOMEWHERE), outline=Outline(0.5))


def test_a_straight_line_on_open_ground_at_any_angle() -> None:
    open_ground = scenario(np.zeros((40, 40), np.bool_), 0.5)
    assert way_m(open_ground, [(5.0, 5.0), (12.0, 15.0)]) == pytest.approx(math.hypot(7.0, 10.0), abs=0.5)


def test_round_the_end_of_a_wall_and_back() -> None:
    solid = np.zeros((20, 20), np.bool_)
    solid[:15, 10] = True  # fields of 1 m: the wall ends at 15 m north
    there = way_m(scenario(solid, 1.0), [(5.0, 5.0), (5.0, 16.0)])
    assert there is not None
    corners = math.hypot(10.5, 5.0) + math.hypot(10.5, 5.0) + 1.0
    assert corners - 2.0 < there < corners + 0.5
    back = way_m(scenario(solid, 1.0), [(5.0, 5.0), (5.0, 16.0), (5.0, 5.0)])
    assert back == pytest.approx(2.0 * there, abs=0.5)
    solid[:, 10] = True
    assert way_m(scenario(solid, 1.0), [(5.0, 5.0), (5.0, 16.0)]) is None


@pytest.mark.parametrize("first", [100, 101, 102, 103])
def test_a_thin_wall_is_no_gap_wherever_it_stands(first: int) -> None:
    solid = np.zeros((200, 200), np.bool_)
    solid[:140, first : first + 2] = True  # 0.2 m thick, 14 m long
    around_m = math.hypot(0.1 * first - 5.0, 9.0) + math.hypot(15.8 - 0.1 * first, 9.0)
    metres = way_m(scenario(solid, 0.1), [(5.0, 5.0), (5.0, 16.0)])
    assert metres is not None and around_m - 0.5 < metres < around_m + 1.5


def test_generated_ground_always_has_one() -> None:
    for kind in ("maze", "yard"):
        spec = RunSpec(kind, "hybrid", "points", "own", "none", False, 0.0, 0.0, "shipped", 1, 100.0, False, "{}")
        mission = mission_of(spec, Path())
        goal = mission.targets[0].place
        ground = made(GroundKind(kind), 1)
        made_scenario = Scenario(ground.world, scenario_from_mission(mission).start, outline=Outline(0.35))
        metres = way_m(made_scenario, [ground.start_m, ground.goal_m])
        assert metres is not None and metres > math.hypot(goal.north_m, goal.east_m) - 0.6  # type: ignore[union-attr]
        assert metres < np.hypot(*np.diff(ground.way_m, axis=0).T).sum() + 1.0, (
            "no longer than the way from field to field"
        )
