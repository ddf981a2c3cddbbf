"""ArduRover's start-up: what is there from when on, and how much later without GPS."""

from __future__ import annotations

from dataclasses import dataclass

STREAMS_S = 3.0
EKF_SEEN_S = 4.0
ATTITUDE_S = 7.0
HOME_S = 10.0
LOCAL_POSITION_S = 11.0
ORIGIN_S = 19.0
PREARM_S = 24.0
POSITION_S = 42.0
ARMABLE_S = 43.0
"""The firmware's start-up, seconds since boot (measured)."""


@dataclass
class GpsLate:
    """How much later than without faults the parts of the start-up come that need GPS, seconds."""

    home_s: float = 0.0
    origin_s: float = 0.0
    position_s: float = 0.0
