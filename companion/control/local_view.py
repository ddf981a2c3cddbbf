"""What a controller sees of one moment: the rover's pose and speed, the map, the rover's limits and the settings."""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings


@dataclass(frozen=True, eq=False, slots=True)
class LocalView:
    """One moment, local frame. ``speed_m_s``: over ground, without a sign."""

    pose: Pose
    speed_m_s: float
    evidence: EvidenceMap
    rover: RoverLimits
    settings: Settings
