"""Motion along one leg with limited speed, acceleration and jerk (behaviour of SCurve; compiled).

Here the jerk changes in steps; in the firmware it rises and falls smoothly.

Nouns: SCurve.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

AHEAD_N, AHEAD_E, LENGTH, START_SPEED, SPEED, TIME, DONE = 0, 1, 2, 3, 4, 5, 6
"""Columns of a leg: direction, length in metres, speeds at the start and in the middle, time since the start in
seconds, metres driven before the time started."""


@njit(cache=True, nogil=True)
def ramp_s(change: float, accel: float, jerk: float) -> float:
    """Duration of a change of speed with limited acceleration and jerk."""
    if change <= accel * accel / jerk:
        return 2.0 * math.sqrt(change / jerk)
    return change / accel + accel / jerk


@njit(cache=True, nogil=True)
def ramp(time_s: float, change: float, accel: float, jerk: float) -> tuple[float, float, float]:
    """Distance, speed and acceleration gained after a time within a change of speed from rest."""
    total_s = ramp_s(change, accel, jerk)
    rise_s = min(accel / jerk, 0.5 * total_s)
    if time_s < rise_s:
        return jerk * time_s**3 / 6.0, 0.5 * jerk * time_s**2, jerk * time_s
    left_s = total_s - time_s
    if left_s < rise_s:
        left_s = max(left_s, 0.0)
        return (
            0.5 * change * total_s - change * left_s + jerk * left_s**3 / 6.0,
            change - 0.5 * jerk * left_s**2,
            jerk * left_s,
        )
    even_s = time_s - rise_s
    top = jerk * rise_s
    speed = 0.5 * top * rise_s
    return top * rise_s**2 / 6.0 + speed * even_s + 0.5 * top * even_s**2, speed + top * even_s, top


@njit(cache=True, nogil=True)
def ramp_m(start: float, end: float, accel: float, jerk: float) -> float:
    """Metres driven while the speed changes."""
    return 0.5 * (start + end) * ramp_s(abs(end - start), accel, jerk)


@njit(cache=True, nogil=True)
def top_speed(length_m: float, start: float, desired: float, accel: float, jerk: float) -> float:
    """The highest speed up to ``desired`` that still allows a stop at the end of a leg; negative if there is none."""
    if ramp_m(start, desired, accel, jerk) + ramp_m(desired, 0.0, accel, jerk) <= length_m:
        return desired
    low, high = min(start, desired), min(desired, start + math.sqrt(accel * length_m))
    if ramp_m(start, low, accel, jerk) + ramp_m(low, 0.0, accel, jerk) > length_m:
        return -1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if ramp_m(start, middle, accel, jerk) + ramp_m(middle, 0.0, accel, jerk) <= length_m:
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def leg_times(leg: Any, accel: float, jerk: float) -> tuple[float, float]:
    """Seconds until braking begins, and until the leg ends."""
    speed, start = leg[SPEED], leg[START_SPEED]
    if speed <= 0.0:
        return 0.0, 0.0
    even_m = leg[LENGTH] - leg[DONE] - ramp_m(start, speed, accel, jerk) - ramp_m(speed, 0.0, accel, jerk)
    braking_s = ramp_s(abs(speed - start), accel, jerk) + max(even_m, 0.0) / speed
    return braking_s, braking_s + ramp_s(speed, accel, jerk)


@njit(cache=True, nogil=True)
def along(leg: Any, time_s: float, accel: float, jerk: float) -> tuple[float, float, float]:
    """Metres along a leg, speed and acceleration at a time since its start."""
    speed, start = leg[SPEED], leg[START_SPEED]
    braking_s, end_s = leg_times(leg, accel, jerk)
    if time_s >= end_s:
        return leg[LENGTH], 0.0, 0.0
    if time_s >= braking_s:
        left_m, left_m_s, left_m_s2 = ramp(end_s - time_s, speed, accel, jerk)
        return leg[LENGTH] - left_m, left_m_s, -left_m_s2
    ramp_end_s = ramp_s(abs(speed - start), accel, jerk)
    if time_s >= ramp_end_s:
        return leg[DONE] + ramp_m(start, speed, accel, jerk) + speed * (time_s - ramp_end_s), speed, 0.0
    gained_m, gained_m_s, gained_m_s2 = ramp(time_s, abs(speed - start), accel, jerk)
    sign = 1.0 if speed >= start else -1.0
    return leg[DONE] + start * time_s + sign * gained_m, start + sign * gained_m_s, sign * gained_m_s2
