"""What planned motions need at each scan: distance fields and time to go on fine evidence (``make bench``)."""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import replace

import numpy as np
import pytest

from companion.control.local_view import LocalView
from companion.control.motion_controller import MotionController
from companion.control.motion_ground import look_round
from companion.control.motion_planners import motion_planner
from companion.control.reference_path import STEP_M, ReferencePath
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.settings.settings_file import parse_settings

AIM_MS, MOST_MS = 5.0, 7.5
"""A busy machine needs half as much again."""
ROVER = Footprint.rectangle(0.9, 0.7)
SETTINGS = parse_settings({"guidance": {"controller": "motion-ga"}, "mapping": {"evidence_m": 0.05}}, "here")
HERE = NedPoint(12.0, 12.0)
COURSES_DEG = (0.0, 45.0)
"""The window is a rectangle: it is largest round a path that leads across it."""


def ground() -> EvidenceMap:
    """40 x 40 m, seen, with 300 obstacles of 0.3 m, none within 1 m of the rover."""
    evidence, chance = new_map(empty_grid(160, 160, 0.25), 0.4, SETTINGS.mapping), np.random.default_rng(0)
    evidence.log_odds[:], evidence.stamps[:] = -2.0, 1
    for north_m, east_m in chance.uniform(0.0, 39.5, (300, 2)):
        if math.hypot(north_m - HERE.north_m, east_m - HERE.east_m) > 1.5:
            y, x = round(north_m / evidence.evidence_m), round(east_m / evidence.evidence_m)
            evidence.log_odds[y : y + 6, x : x + 6] = 3.0
    return evidence


def path(course_deg: float) -> ReferencePath:
    """16 m straight on."""
    along_m, course_rad = np.arange(0.0, 16.0, STEP_M), math.radians(course_deg)
    points = HERE.north_m + along_m * math.cos(course_rad), HERE.east_m + along_m * math.sin(course_rad)
    return ReferencePath(np.column_stack(points))


@pytest.mark.parametrize("course_deg", COURSES_DEG)
@pytest.mark.benchmark(timer=time.thread_time)
def test_the_ground_is_looked_at(benchmark, course_deg: float) -> None:
    """Within 5 ms of processor time; and what share that is of a tick of the controller that takes a new scan in."""
    evidence, leads, numbers = ground(), MotionController(ROVER, motion_planner("motion-ga", 0)), itertools.count(1)
    at = LocalView(
        Pose(HERE.north_m, HERE.east_m, math.radians(course_deg), 0.0), 1.0, evidence,
        RoverLimits(ROVER.radius_m, 2.0, 8.0), SETTINGS,
    )  # fmt: skip
    ahead, follows_s = path(course_deg), []

    def follow() -> None:
        number = next(numbers)
        began_s = time.thread_time()
        leads.follow(ahead, replace(at, pose=replace(at.pose, time_s=0.05 * number), scans=number))
        follows_s.append(time.thread_time() - began_s)

    benchmark.pedantic(
        look_round, args=(evidence, HERE, ahead, leads._body, 2.0), setup=follow, rounds=100, warmup_rounds=5
    )
    median_ms, follow_ms = 1e3 * benchmark.stats.stats.median, 1e3 * float(np.median(follows_s[5:]))
    print(
        f"\ncells of {evidence.evidence_m:g} m, a path {course_deg:g} degrees from north: {median_ms:.2f} ms "
        f"(aim: {AIM_MS:g}), {median_ms / follow_ms:.0%} of the controller's {follow_ms:.2f} ms"
    )
    assert median_ms < MOST_MS
