"""ArduRover's parameters that limit how fast speed and turn rate change."""

from __future__ import annotations

ACCELERATION, DECELERATION, TURN_ACCELERATION = "ATC_ACCEL_MAX", "ATC_DECEL_MAX", "ATC_STR_ACC_MAX"
"""m/s², m/s² (0: the one before) and degrees/s²; 0: without a limit."""
LIMITS = (ACCELERATION, DECELERATION, TURN_ACCELERATION)
