"""The outline hint: what planned motions would open for a long rover, which counts as the circle round it without them.

Nouns: outline hint.
"""

from __future__ import annotations

from companion.mission.field_size import field_size, finer_gap_m
from companion.mission.mission import RoverSpec
from companion.settings import MappingSettings
from companion.settings.settings_file import FOR_PLANNED_MOTIONS

WORTH_M = 0.15
"""Gaps that are narrower by less than this are not worth another controller."""


def outline_hint(rover: RoverSpec, controller: str = "points") -> str:
    """A line about narrower gaps with planned motions; empty where they would open none, or are planned already."""
    if rover.rectangle is None or rover.turning_radius_m > 0.0 or controller != "points":
        return ""
    planned = MappingSettings.model_validate(FOR_PLANNED_MOTIONS["mapping"])
    round_m, long_m = _gap_m(rover, MappingSettings()), _gap_m(rover, planned)
    if long_m > round_m - WORTH_M:
        return ""
    return (
        f"the rover counts as the circle round its outline, for gaps of {round_m:.1f} m or more; with a lidar, "
        f'guidance.controller = "motion-ga" in --settings drives through {long_m:.1f} m (docs/planned-motions.md)'
    )


def _gap_m(rover: RoverSpec, settings: MappingSettings) -> float:
    side_m = field_size(rover, settings).fine_m
    return finer_gap_m(rover, settings, side_m)
