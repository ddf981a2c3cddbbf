"""Whether the ground behind a rover was ever seen."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from companion.control.blind_behind import BEHIND_M, CREEPS_M_S, is_blind_behind
from companion.control.local_view import LocalView
from companion.control.motion_controller import rover_model
from companion.core.footprint import Footprint
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings
from tests.companion.control.test_motion_ground import ground

SETTINGS = Settings.model_validate({"guidance": {"controller": "motion-ga", "velocity_lasts_s": 0.3}})
OFF_CENTRE = Footprint.rectangle(1.2, 0.7, 0.35)


def at(evidence: EvidenceMap, pose: Pose, body: Footprint = OFF_CENTRE) -> LocalView:
    return LocalView(pose, 0.0, evidence, RoverLimits(body.radius_m, 2.0, 8.0), SETTINGS, body=body)


def forgotten(evidence: EvidenceMap, north_m: tuple[float, float], east_m: tuple[float, float]) -> EvidenceMap:
    """The same ground with a piece of it that was never seen."""
    rows, columns = (slice(*(round(one / evidence.evidence_m) for one in pair)) for pair in (north_m, east_m))
    evidence.log_odds[rows, columns] = 0.0
    evidence.stamps[rows, columns] = 0
    return evidence


@pytest.mark.parametrize("heading_deg", [0.0, 45.0, 117.0, 270.0])
def test_it_looks_behind_the_tail_whatever_the_heading(heading_deg: float) -> None:
    heading_rad, evidence = math.radians(heading_deg), ground()
    pose = Pose(10.0, 10.0, heading_rad, 0.0)
    assert not is_blind_behind(at(evidence, pose))
    ahead, behind = (pose.point.moved(heading_rad, far_m) for far_m in (1.5, -(OFF_CENTRE.rear_m + 0.5 * BEHIND_M)))
    around = [((one.north_m - 0.3, one.north_m + 0.3), (one.east_m - 0.3, one.east_m + 0.3)) for one in (ahead, behind)]
    assert not is_blind_behind(at(forgotten(evidence, *around[0]), pose))
    blind = at(forgotten(evidence, *around[1]), pose)
    assert is_blind_behind(blind) and rover_model(blind).backwards_m_s == CREEPS_M_S
    seen = at(ground(), pose)
    assert rover_model(seen).backwards_m_s == SETTINGS.motion.backwards_m_s > CREEPS_M_S


def test_a_few_cells_that_no_ray_met_do_not_make_it_blind() -> None:
    pose = Pose(10.0, 10.0, 0.0, 0.0)
    assert not is_blind_behind(at(forgotten(ground(), (9.4, 9.5), (9.9, 10.0)), pose))


def test_nothing_is_known_beyond_the_map() -> None:
    evidence = ground()
    far_m = evidence.log_odds.shape[0] * evidence.evidence_m
    edge = Pose(far_m - 0.5, 10.0, math.pi, 0.0)  # it looks south: its tail is at the northern edge
    assert is_blind_behind(at(evidence, edge)) and not is_blind_behind(at(evidence, replace(edge, heading_rad=0.0)))
