"""Which controller leads: motions are planned for rovers that see enough and turn on the spot."""

from __future__ import annotations

import numpy as np
import pytest

from companion.core.scan import RangeScan
from companion.executive.controller_choice import controller_in_force, settings_in_force
from companion.settings import ControllerKind, Settings, parse_settings

LIDAR = RangeScan(0.0, np.radians(np.arange(-45.0, 45.0, 5.0)), np.full(18, 3.0), 0.2, 8.0, 0.1, "lidar")
BEAM = RangeScan(0.0, np.array([0.0]), np.array([3.0]), 0.2, 8.0, 0.1, "beam")


@pytest.mark.parametrize("kind", ["motion-ga", "dwa", "mppi", "points"])
def test_thin_beams_and_arcs_are_driven_with_points(kind: ControllerKind) -> None:
    assert controller_in_force(kind, narrow_sight=False, turning_radius_m=0.0) == kind
    assert controller_in_force(kind, narrow_sight=True, turning_radius_m=0.0) == "points"
    assert controller_in_force(kind, narrow_sight=False, turning_radius_m=1.5) == "points"


@pytest.mark.parametrize(("scan", "radius_m", "back"), [(LIDAR, 0.0, False), (BEAM, 0.0, True), (LIDAR, 2.0, True)])
def test_the_map_is_made_for_the_controller_in_force(scan: RangeScan, radius_m: float, back: bool) -> None:
    """Points keep a circle clear; on a map for outlines they would be sent through gaps that they cannot pass."""
    asked = parse_settings({"guidance": {"controller": "motion-ga"}, "mapping": {"evidence_m": 0.2}}, "here")
    given = settings_in_force(asked, scan, radius_m)
    assert asked.mapping.keeps == "outline"
    assert given.guidance.controller == ("points" if back else "motion-ga")
    assert given.mapping.keeps == ("circle" if back else "outline")
    assert given.mapping.hit_depth_m == (Settings() if back else asked).mapping.hit_depth_m
    assert given.mapping.evidence_m == 0.2, "what the user set stays"
    assert settings_in_force(asked, None, 0.0) == asked
