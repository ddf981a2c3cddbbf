"""The table of drives among things that move."""

from __future__ import annotations

import numpy as np
import pytest

from companion.planning.contract_problems import BUDGET, random_problem
from companion.planning.registry import make_planner
from sitl.experiments.experiment import Options
from sitl.experiments.traffic import MADE, TrafficDrive, TrafficReport, Way, drive, settings_for


def one(way: Way, seed: int, seconds: float, *, touched: int = 0, run_into: int = 0) -> TrafficDrive:
    return TrafficDrive("Crossing", way, seed, touched, run_into, 0, 0, seconds)


def rows_of(report: TrafficReport) -> dict[str, list[str]]:
    lines = (line for line in report.section().splitlines() if line.startswith("| "))
    return {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ") for line in lines}


def test_ways_that_differ_in_one_thing_are_compared_on_the_same_seeds() -> None:
    times_s = {
        Way.HYBRID: (10.0, 20.0),
        Way.YIELD: (100.0, 200.0),
        Way.ONE_SPEED: (50.0, 100.0),
        Way.SPEEDS: (25.0, 50.0),
        Way.MOTIONS: (9.9, 20.1),
    }
    touched = {Way.YIELD: (0, 3), Way.SPEEDS: (1, 0)}
    drives = [
        one(way, seed, seconds, touched=touched.get(way, (0, 0))[seed], run_into=2 * seed)
        for way in Way
        for seed, seconds in enumerate(times_s[way])
    ]
    rows = rows_of(TrafficReport(Options(runs=2), tuple(drives)))
    assert rows["yield only"][1:5] == ["2", "3", "0.500 (0.013 to 0.987)", "2"]
    assert rows["plan, one speed"][2:4] == ["0", "0.000 (0.000 to 0.842)"]
    assert rows["plan, one speed / yield only"][1:] == ["0", "1", "2", "0.500 (0.500 to 0.500)"]
    assert rows["plan, speeds / plan, one speed"][1:] == ["1", "0", "2", "0.500 (0.500 to 0.500)"]
    assert rows["plan, speeds / yield only"][1:] == ["1", "1", "2", "0.250 (0.250 to 0.250)"]
    assert rows["motions / hybrid"][-1].startswith("1.000 (0.9")


def test_the_ways_differ_in_what_they_know_of_things_that_move() -> None:
    knows = {
        way: make_planner(settings_for(way).navigator.planner, settings_for(way).planner).capabilities for way in Way
    }
    assert [way for way in Way if knows[way].moving_obstacles] == [Way.ONE_SPEED, Way.SPEEDS]
    one_speed, speeds = (settings_for(way).planner.vertex.speed_levels for way in (Way.ONE_SPEED, Way.SPEEDS))
    assert one_speed == 1 < speeds


def test_yielding_only_is_the_planner_with_one_speed_that_knows_nothing_of_what_moves() -> None:
    plain, one_speed = (
        make_planner(settings_for(way).navigator.planner, settings_for(way).planner)
        for way in (Way.YIELD, Way.ONE_SPEED)
    )
    found = 0
    for number in range(40):
        problem = random_problem(np.random.default_rng(number))
        paths = [planner.plan(problem, BUDGET, np.random.default_rng(number)).path for planner in (plain, one_speed)]
        cells = [path and path.cells for path in paths]
        assert cells[0] == cells[1]
        found += cells[0] is not None
    assert found > 10


@pytest.mark.thorough
def test_on_made_ground_with_movers_planned_motions_arrive() -> None:
    made = drive("clutter", Way.MOTIONS, 0)
    assert (made.course, made.missed) == (MADE, 0) and made.seconds > 20.0
