"""The outline hint: what planned motions would open for a long rover, which counts as the circle round it without them.

Nouns: outline hint.
"""

from __future__ import annotations

import math

from companion.mission.field_size import field_size, finer_gap_m
from companion.mission.mission import RoverSpec
from companion.settings import MappingSettings
from companion.settings.settings_file import FOR_PLANNED_MOTIONS

WORTH_M = 0.15
"""Gaps that are narrower by less than this are not worth another controller."""


def outline_hint(rover: RoverSpec, controller: str = "points") -> str:
    """A line about narrower gaps with planned motions; empty where they would open none, or are planned already.

    On larger ground than it says fields are larger.
    """
    if rover.rectangle is None or rover.turning_radius_m > 0.0 or controller != "points":
        return ""
    planned = MappingSettings.model_validate(FOR_PLANNED_MOTIONS["mapping"])
    round_m, long_m = _gap_m(rover, MappingSettings()), _gap_m(rover, planned)
    if long_m > round_m - WORTH_M:
        return ""
    size = field_size(rover, planned)
    across_m = math.floor(size.fine_m * math.sqrt(size.most) / 10.0) * 10
    return (
        "the rover counts as the circle round its outline; with a lidar and a guard (rover-companion guard), "
        f'guidance.controller = "motion-ga" in --settings drives through gaps of {long_m:.1f} m, on ground of up to '
        f"{across_m} x {across_m} m (docs/planned-motions.md)"
    )


def guard_hint(rover: RoverSpec, controller: str) -> str:
    """A line about what planned motions need in narrow ground; empty where none are planned."""
    if controller == "points" or rover.turning_radius_m > 0.0:
        return ""
    return (
        "gaps less than half a metre wider than the rover need a guard on the autopilot (rover-companion guard); "
        "without one it seldom gets through the narrowest"
    )


def _gap_m(rover: RoverSpec, settings: MappingSettings) -> float:
    side_m = field_size(rover, settings).fine_m
    return finer_gap_m(rover, settings, side_m)
