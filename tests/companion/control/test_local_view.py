"""What a controller sees of one moment."""

from __future__ import annotations

from dataclasses import replace

from companion.control.local_view import LocalView
from companion.core.frames import Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import new_map
from companion.settings import Settings


def test_other_speeds_change_nothing_else() -> None:
    settings, rover = Settings(), RoverLimits(0.35, 2.0, 8.0, turning_radius_m=2.5)
    view = LocalView(Pose(1.0, 2.0, 0.5, 3.0), 1.5, new_map(empty_grid(4, 4), 0.35, settings.mapping), rover, settings)
    faster = view.with_speeds(3.0, 4.0)
    assert faster.rover == replace(rover, cruise_speed_m_s=3.0, fastest_m_s=4.0) and view.rover == rover
    assert (faster.pose, faster.speed_m_s, faster.evidence) == (view.pose, view.speed_m_s, view.evidence)
    assert faster.settings is view.settings
