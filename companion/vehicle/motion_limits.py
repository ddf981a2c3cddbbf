"""ArduRover's parameters that limit speed and turn rate where a velocity is told, and how fast they change."""

from __future__ import annotations

ACCELERATION, DECELERATION, TURN_ACCELERATION = "ATC_ACCEL_MAX", "ATC_DECEL_MAX", "ATC_STR_ACC_MAX"
"""m/s², m/s² (0: the one before) and degrees/s²; 0: without a limit."""
FASTEST, CRUISE, TURN_RATE = "WP_SPEED", "CRUISE_SPEED", "ATC_STR_RAT_MAX"
"""m/s, m/s (counts where the one before is 0) and degrees/s (0: without a limit)."""
CHANGES = (ACCELERATION, DECELERATION, TURN_ACCELERATION)
LIMITS = (*CHANGES, FASTEST, CRUISE, TURN_RATE)
