"""What limits a rover: its size, speed, sight and turning."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RoverLimits:
    """The rover as guidance sees it."""

    radius_m: float
    cruise_speed_m_s: float
    sight_m: float
    """Valid range of the sensor."""
    narrow_sight: bool = False
    """Whether it is single thin beams."""
    turning_radius_m: float = 0.0
    """The tightest arc it can drive; 0: it turns on the spot."""
