"""Where the rover may be sent and left alone, on maps drawn by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.control.braking import blind_distance_m
from companion.control.local_view import LocalView
from companion.control.reference_path import STEP_M, ReferencePath
from companion.control.safe_reach import BACK_LEAST_M_S, arc_is_free, backing_speed_m_s, farthest_clear
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_edits import look_again
from companion.settings import Settings

SETTINGS = Settings()
GUIDANCE = SETTINGS.guidance
ROVER = RoverLimits(0.35, 2.0, 8.0)
HERE = Pose(4.0, 10.0, 0.0, 0.0)
NORTHWARD = ReferencePath(np.column_stack((np.arange(4.0, 18.0, STEP_M), np.full(56, 10.0))))


def ground(seen_north_m: float = 20.0) -> EvidenceMap:
    """Seen free up to a line across."""
    evidence = new_map(empty_grid(20, 20), 0.35, SETTINGS.mapping)
    evidence.log_odds[: round(seen_north_m / evidence.evidence_m)] = -1.0
    return evidence


def put(evidence: EvidenceMap, north_m: float, east_m: float, value: float = 2.0) -> None:
    y, x = (int(v / evidence.evidence_m) for v in (north_m, east_m))
    evidence.log_odds[y : y + 2, x : x + 2] = value


def view(evidence: EvidenceMap, pose: Pose = HERE, speed_m_s: float = 0.0) -> LocalView:
    return LocalView(pose, speed_m_s, evidence, ROVER, SETTINGS)


def reach_m(evidence: EvidenceMap, speed_m_s: float = 0.0) -> float:
    return farthest_clear(NORTHWARD, view(evidence, speed_m_s=speed_m_s)).distance_m


def test_the_target_leaves_room_for_front_and_overshoot_before_what_was_not_seen() -> None:
    for speed_m_s in (0.0, 2.0):
        reached_m = reach_m(ground(8.0), speed_m_s)
        assert 2.5 <= reached_m <= 4.0 - 0.35 - GUIDANCE.overshoot_m + 0.11
    assert reach_m(ground()) >= GUIDANCE.horizon_m - STEP_M


def test_a_rover_that_the_ground_holds_gets_so_much_more_room_however_near_its_position_is() -> None:
    for seen_north_m in (8.0, 11.0):
        free = view(ground(seen_north_m))
        held = replace(free, held_m_s=0.5)
        nearer_m = farthest_clear(NORTHWARD, free).distance_m - farthest_clear(NORTHWARD, held).distance_m
        assert nearer_m == pytest.approx(0.5 * GUIDANCE.held_overshoot_s, abs=0.2)


def test_a_flank_that_was_not_seen_ends_it_however_far_away() -> None:
    evidence = ground()
    whole_m = reach_m(evidence)
    put(evidence, 9.0, 10.4, 0.0)
    assert reach_m(evidence) < 5.0 < whole_m


def test_at_the_edge_of_the_map_nothing_more_needs_to_be_seen() -> None:
    path = ReferencePath(np.column_stack((np.arange(4.0, -0.01, -STEP_M) + 0.5, np.full(17, 10.0))))
    pose = Pose(4.5, 10.0, math.pi, 0.0)
    assert farthest_clear(path, view(ground(), pose)).target.north_m < 0.8


def test_the_arc_to_a_target_aside_is_looked_along() -> None:
    evidence, aside = ground(), NedPoint(8.0, 12.0)
    assert arc_is_free(view(evidence), aside)
    put(evidence, 6.0, 10.2)  # not on the straight line, but where the rover swings out to
    assert not arc_is_free(view(evidence), aside)
    assert not arc_is_free(view(ground(), Pose(4.0, 10.0, math.pi, 0.0)), aside), "behind"
    assert arc_is_free(view(evidence, Pose(4.0, 10.0, HERE.point.bearing_rad(aside), 0.0)), aside)


def test_backing_off_is_as_slow_as_the_room_behind_asks_for() -> None:
    pose, evidence = Pose(10.0, 10.0, 0.0, 0.0), ground()
    assert backing_speed_m_s(view(evidence, pose)) == GUIDANCE.back_out_speed_m_s
    put(evidence, 8.4, 10.0)
    near_m_s = backing_speed_m_s(view(evidence, pose))
    assert BACK_LEAST_M_S < near_m_s < GUIDANCE.back_out_speed_m_s
    assert blind_distance_m(near_m_s, GUIDANCE) < 1.6 - 0.35
    put(evidence, 9.2, 10.0)
    assert backing_speed_m_s(view(evidence, pose)) < BACK_LEAST_M_S


def test_the_rover_does_not_back_off_the_map() -> None:
    evidence = ground()
    edge = evidence.base.south_west
    near, far = (Pose(edge.north_m + north_m, edge.east_m + 5.0, 0.0, 0.0) for north_m in (0.4, 4.0))
    assert backing_speed_m_s(view(evidence, near)) < BACK_LEAST_M_S < backing_speed_m_s(view(evidence, far))


def test_looking_again_forgets_only_what_was_not_just_seen() -> None:
    evidence = ground()
    evidence.base.weights[2, 2] = 1.0
    for north_m, stamp in ((8.0, 3), (12.0, 90)):
        put(evidence, north_m, 5.0)
        y, x = int(north_m / evidence.evidence_m), int(5.0 / evidence.evidence_m)
        evidence.stamps[y : y + 2, x : x + 2] = stamp
    evidence.seen.add(0, 0, *reversed(evidence.log_odds.shape))
    look_again(evidence, 80)
    at = [evidence.log_odds[int(n / evidence.evidence_m), int(5.0 / evidence.evidence_m)] for n in (8.0, 12.0, 16.0)]
    assert at[0] == 0.0 and at[1] == 2.0 and at[2] == -1.0
    assert evidence.grid.weights[2, 2] == 1.0
