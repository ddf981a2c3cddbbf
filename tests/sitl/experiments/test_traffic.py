"""The table of drives among things that move."""

from __future__ import annotations

import pytest

from companion.planning.registry import make_planner
from sitl.experiments.experiment import Options
from sitl.experiments.traffic import MADE, TrafficDrive, TrafficReport, Way, drive, settings_for


def one(way: Way, seed: int, seconds: float, *, touched: int = 0, run_into: int = 0) -> TrafficDrive:
    return TrafficDrive("Crossing", way, seed, touched, run_into, 0, 0, seconds)


def test_each_way_is_compared_with_making_way_on_the_same_seeds() -> None:
    times_s = {
        Way.MAKE_WAY: (100.0, 200.0),
        Way.ONE_SPEED: (50.0, 100.0),
        Way.SPEEDS: (100.0, 200.0),
        Way.MOTIONS: (99.0, 201.0),
    }
    drives = [
        one(way, seed, seconds, touched=seed, run_into=2 * seed)
        for way in Way
        for seed, seconds in enumerate(times_s[way])
    ]
    text = TrafficReport(Options(runs=2), tuple(drives)).section()
    rows = {
        line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ")
        for line in text.splitlines()
        if line.startswith("| ")
    }
    assert rows["make way"][2:4] == ["1", "2"] and rows["make way"][-1] == "1"
    assert rows["plan, one speed"][-1] == "0.500 (0.500 to 0.500)"
    assert rows["motions"][-1].startswith("1.000 (0.9")


def test_the_ways_differ_in_what_they_know_of_things_that_move() -> None:
    knows = {
        way: make_planner(settings_for(way).navigator.planner, settings_for(way).planner).capabilities for way in Way
    }
    assert [way for way in Way if knows[way].moving_obstacles] == [Way.ONE_SPEED, Way.SPEEDS]
    assert (
        settings_for(Way.ONE_SPEED).planner.vertex.speed_levels
        == 1
        < settings_for(Way.SPEEDS).planner.vertex.speed_levels
    )


@pytest.mark.thorough
def test_on_made_ground_with_movers_planned_motions_arrive() -> None:
    made = drive("clutter", Way.MOTIONS, 0)
    assert (made.course, made.missed) == (MADE, 0) and made.seconds > 20.0
