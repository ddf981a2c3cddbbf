"""Open gaps: the narrowest gap that is sure to be open on a mission's map, by the map as it is laid.

Nouns: open gap.
"""

from __future__ import annotations

from companion.core.frames import GeoPoint, Pose
from companion.executive.controller_choice import settings_for
from companion.executive.mission_layout import lay
from companion.mapping.evidence_map import EvidenceMap
from companion.mission.field_size import sure_gap_m
from companion.mission.mission import Mission, RoverSpec
from companion.settings import Settings

AT_HOME = Pose(0.0, 0.0, 0.0, 0.0)


def open_gap_m(rover: RoverSpec, evidence: EvidenceMap) -> float:
    """The narrowest gap by the cells that the map has: they may be larger than the settings want them."""
    settings = evidence.settings.model_copy(update={"evidence_m": evidence.evidence_m})
    return sure_gap_m(rover, settings, evidence.base.resolution_m)


def map_at_start(mission: Mission, settings: Settings, home: GeoPoint, *, narrow_sight: bool) -> EvidenceMap:
    """The map with which a run begins that has its home here. Raises MissionError."""
    turning_radius_m = mission.rover.turning_radius_m
    in_force = settings_for(settings, narrow_sight=narrow_sight, turning_radius_m=turning_radius_m)
    return lay(mission, in_force.mapping, home, home, AT_HOME, narrow_sight=narrow_sight).evidence
