"""ArduRover's parameters that tell how fast the rover may drive and turn, how fast that changes, and its throttle."""

from __future__ import annotations

ACCELERATION, DECELERATION, TURN_ACCELERATION = "ATC_ACCEL_MAX", "ATC_DECEL_MAX", "ATC_STR_ACC_MAX"
"""m/s², m/s² (0: the one before) and degrees/s²; 0: without a limit."""
FASTEST, CRUISE, TURN_RATE = "WP_SPEED", "CRUISE_SPEED", "ATC_STR_RAT_MAX"
"""m/s, m/s (counts where the one before is 0) and degrees/s (0: without a limit)."""
CRUISE_THROTTLE = "CRUISE_THROTTLE"
"""Per cent with which it drives at ``CRUISE_SPEED`` on firm ground."""
CHANGES = (ACCELERATION, DECELERATION, TURN_ACCELERATION)
LIMITS = (*CHANGES, FASTEST, CRUISE, TURN_RATE)
DRIVE = (CRUISE, CRUISE_THROTTLE)
"""What tells how fast the rover drives with which throttle."""
