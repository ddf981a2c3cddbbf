"""What limits a rover: its size, speed, sight and turning.

Nouns: rover limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class RoverLimits:
    """The rover as the controllers see it."""

    radius_m: float
    cruise_speed_m_s: float
    sight_m: float
    """Valid range of the sensor."""
    narrow_sight: bool = False
    """Whether the sensor is single thin beams."""
    beam_rad: float = math.radians(5.0)
    """The width that each reading of the sensor speaks for."""
    turning_radius_m: float = 0.0
    """The tightest arc it can drive; 0: it turns on the spot."""
    fastest_m_s: float = math.inf
    """The highest speed on its present way; the way may be planned with lower speeds in places."""
    told_most_m_s: float = math.inf
    turns_most_rad_s: float = math.inf
    """Told a velocity, the autopilot lets it drive and turn no faster."""
