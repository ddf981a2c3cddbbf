"""What leads the rover, compared: the grounds, the pairs, and what the report makes of them."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.experiments.controllers import (
    ControllersReport,
    GroundDrive,
    drive,
    mission_on,
    run,
    settings_for,
)
from sitl.experiments.experiment import ExperimentError, Options
from sitl.experiments.intervals import ratio_with_interval
from sitl.generators.canvas import EAST_M, NORTH_M
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import made as drawn
from sitl.generators.shortest_way import BODY_M


@pytest.mark.parametrize("kind", list(GroundKind))
def test_a_ground_comes_from_its_seed_and_its_ends_are_free(kind: GroundKind) -> None:
    one, again, other = drawn(kind, 3), drawn(kind, 3), drawn(kind, 4)
    assert np.array_equal(one.world.obstacles, again.world.obstacles) and one.goal_m == again.goal_m
    assert not np.array_equal(one.world.obstacles, other.world.obstacles)
    for ground in (one, other):
        for north_m, east_m in (ground.start_m, ground.goal_m):
            assert 0.0 < north_m < NORTH_M and 0.0 < east_m < EAST_M
            assert ground.world.clearance_m(north_m, east_m, 2.0) > BODY_M
        middle = ground.world.obstacles[1:-1, 80:-80]
        assert 0.01 < middle.mean() < 0.35


def test_both_of_a_pair_are_sent_to_the_same_place() -> None:
    ground = drawn(GroundKind.ROOMS, 0)
    points, planned = mission_on(ground, "points", 0), mission_on(ground, "motion-ga", 0)
    assert points.targets == planned.targets and points.rover == planned.rover
    assert settings_for("points").navigator.planner == "theta-star"
    assert settings_for("motion-ga").guidance.controller == "motion-ga"


def made(controller: str, seed: int, seconds: float, reached: bool = True, contacts: int = 0) -> GroundDrive:
    return GroundDrive(controller, GroundKind.YARD, seed, reached, contacts, 0, seconds)


def test_times_are_compared_where_both_reach_the_goal() -> None:
    drives = (
        made("points", 0, 40.0), made("points", 1, 60.0), made("points", 2, 99.0, reached=False),
        made("motion-ga", 0, 20.0), made("motion-ga", 1, 30.0, contacts=1), made("motion-ga", 2, 5.0),
    )  # fmt: skip
    report = ControllersReport(Options(runs=3), drives)
    points, planned = (row[1:] for row in report._rows(GroundKind.YARD))
    assert points[:5] == ["3", "2", "0", "0", "2"] and points[-1] == "1.000 (1.000 to 1.000)"
    assert planned[:5] == ["3", "3", "1", "0", "2"]
    assert planned[5:7] == ["25.0", "50.0"] and planned[-1] == "0.500 (0.500 to 0.500)"
    assert report._rows(GroundKind.ROOMS) == [], "nothing was driven there"
    assert "0.500" in report.section()


def test_two_that_plan_motions_are_compared_on_the_same_grounds() -> None:
    """Not their means over other grounds: the second ground, which one did not reach, counts for neither."""
    drives = (
        made("points", 0, 80.0), made("points", 1, 80.0), made("points", 2, 80.0),
        made("motion-ga", 0, 20.0), made("motion-ga", 1, 90.0), made("motion-ga", 2, 40.0),
        made("dwa", 0, 40.0), made("dwa", 1, 50.0, reached=False, contacts=1), made("dwa", 2, 40.0),
        made("mppi", 0, 20.0, reached=False), made("mppi", 1, 30.0, reached=False), made("mppi", 2, 9.0, reached=False),
    )  # fmt: skip
    report = ControllersReport(Options(runs=3), drives)
    ga_dwa, ga_mppi, dwa_mppi = report._pair_rows(GroundKind.YARD)
    assert ga_dwa == ["motion-ga / dwa", "0", "1", "2", "30.0", "40.0", "0.750 (0.500 to 1.000)"]
    assert ga_mppi == ["motion-ga / mppi", "0", "0", "0", "-", "-", "-"] and dwa_mppi[0] == "dwa / mppi"
    assert "| motion-ga / dwa | 0 | 1 | 2 | 30.0 | 40.0 | 0.750 (0.500 to 1.000) |" in report.section()
    titles = [str(table.title) for table in report.tables()]
    assert titles.count("controllers: yard") == 2 and titles.count("controllers: rooms") == 1


def test_the_interval_holds_the_ratio_and_grows_with_scatter() -> None:
    rng = np.random.default_rng(1)
    base = rng.uniform(40.0, 80.0, 100)
    widths = []
    for scatter in (0.02, 0.3):
        pairs = np.column_stack((0.7 * base * rng.normal(1.0, scatter, 100), base))
        ratio, low, high = (float(v) for v in ratio_with_interval(pairs).strip(")").replace(" (", " to ").split(" to "))
        assert low <= ratio <= high and abs(ratio - 0.7) < 0.1
        widths.append(high - low)
    assert widths[1] > 3.0 * widths[0]


def test_an_unknown_controller_is_refused() -> None:
    with pytest.raises(ExperimentError, match="--controllers: 'teleport' is unknown"):
        run(Options(controllers=("teleport",)), lambda done, total: None)


@pytest.mark.thorough
@pytest.mark.parametrize("controller", ["motion-ga", "mppi"])
def test_a_rover_that_drove_to_and_fro_at_a_door_of_its_own_width_finds_the_other_way(controller: str) -> None:
    """A wall stands in the door of this ground and leaves 0.8 m; both drove there until the time was over."""
    there = drive(GroundKind.ROOMS, controller, 11)
    assert there.reached and there.contacts == 0 and there.refused == 0
    assert there.seconds < 300.0
