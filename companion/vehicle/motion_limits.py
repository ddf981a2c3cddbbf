"""ArduRover's parameters: how fast the rover may drive and turn, how fast that changes, how long a velocity lasts."""

from __future__ import annotations

import math
from collections.abc import Mapping

ACCELERATION, DECELERATION, TURN_ACCELERATION = "ATC_ACCEL_MAX", "ATC_DECEL_MAX", "ATC_STR_ACC_MAX"
"""m/s², m/s² (0: the one before) and degrees/s²; 0: without a limit."""
FASTEST, CRUISE, TURN_RATE = "WP_SPEED", "CRUISE_SPEED", "ATC_STR_RAT_MAX"
"""m/s, m/s (counts where the one before is 0) and degrees/s (0: without a limit)."""
CRUISE_THROTTLE = "CRUISE_THROTTLE"
"""Per cent with which it drives at ``CRUISE_SPEED`` on firm ground."""
CHANGES = (ACCELERATION, DECELERATION, TURN_ACCELERATION)
LIMITS = (*CHANGES, FASTEST, CRUISE, TURN_RATE)
THROTTLE_SCALE = (CRUISE, CRUISE_THROTTLE)
"""What tells how fast the rover drives with which throttle."""
TIMEOUT, LEAST_TIMEOUT_S, MOST_TIMEOUT_S = "GUID_TIMEOUT", 0.1, 30.0
"""Seconds for which the last velocity goes on; less than the second counts as that, with more than the third no ways
are planned. Older firmware has no such parameter: there it is always 3 s."""
CRUISE_M_S, CRUISE_PERCENT = 2.0, 50.0
"""Both as ArduRover is shipped."""


def full_throttle_m_s(parameters: Mapping[str, float]) -> float:
    """How fast the rover goes on firm ground with its throttle fully open: 100 CRUISE_SPEED / CRUISE_THROTTLE.

    Where either is not known or 0, both are taken to be as shipped.
    """
    speed_m_s, percent = (parameters.get(name, 0.0) for name in THROTTLE_SCALE)
    if speed_m_s <= 0.0 or percent <= 0.0:
        speed_m_s, percent = CRUISE_M_S, CRUISE_PERCENT
    return 100.0 * speed_m_s / percent


def velocity_lasts_s(parameters: Mapping[str, float], otherwise_s: float) -> float:
    """How long the last velocity goes on: as the autopilot tells, or ``otherwise_s`` where it does not."""
    told_s = parameters.get(TIMEOUT, math.nan)
    return otherwise_s if math.isnan(told_s) else min(max(told_s, LEAST_TIMEOUT_S), MOST_TIMEOUT_S)
