"""What ``wang-table4`` says of on-line against off-line planning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from companion.planning.papers.wang_ga import Plan
from sitl.experiments.wang_environments import ENVIRONMENTS
from sitl.experiments.wang_table4 import SETTINGS, TIME, Entry, _detail, _quicker
from sitl.experiments.wang_trip import Trip, make_trip


def plan(first: int) -> Plan:
    return Plan(np.array([[0, 0], [3, 4]]), np.array([0.5]), 10.0, first, 1000, 1000)


def trip(online: int, offline: int, offline_first_ms: float = 3.0) -> Trip:
    return Trip(plan(offline), plan(online), 2.0, 30.0, 20.0, offline_first_ms, 1.0)


def test_rows_in_which_on_line_planning_needs_less_are_counted() -> None:
    entries = (Entry(TIME, 1, (trip(10, 20),)), Entry(TIME, 2, (trip(30, 20, offline_first_ms=1.0),)))
    assert _quicker(entries) == (
        "generations until the first feasible path in 1, time until then in 1, and time for 1000 generations in 0 of "
        "the 2 rows"
    )
    assert _detail(entries[0])[5:8] == ["20", "3 ms", "20 ms"]


def test_the_first_feasible_path_off_line_is_that_of_the_plan_and_is_timed() -> None:
    made = make_trip(ENVIRONMENTS[1], SETTINGS[TIME], 0)
    assert made.offline_first_ms > 0.0
    entry = Entry(TIME, 1, (replace(made, online=made.offline, first_ms=1.0, all_ms=1.0, gap_m=1.0),))
    assert entry.figures()["offline_first_generations"] == made.offline.first_feasible
