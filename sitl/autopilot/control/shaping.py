"""Motion laws that the controllers share: square-root approach, acceleration and jerk limits (compiled).

Behaviour of ArduPilot's ``AP_Math/control``: a small error is reduced in proportion, a large one with constant
acceleration; a target moves with limited speed, acceleration and jerk.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

APPROACH_SHARE = 0.5
"""Share of the acceleration and of the gain with which the approach to a place is planned."""

CORNER_SHARE = 1.0 / math.sqrt(2.0)
"""Share of the acceleration that stays available across the direction of travel."""

Vector = tuple[float, float]
"""North and east."""


class ShapingLimits(NamedTuple):
    """What a shaped target keeps to, in m/s, m/s^2 and m/s^3; a speed of 0 is no limit."""

    speed_max: float
    accel_max: float
    jerk_max: float


@njit(cache=True, nogil=True)
def limited(value: float, limit: float) -> float:
    """The value within plus or minus the limit; NaN becomes 0, as in the firmware."""
    if math.isnan(value):
        return 0.0
    return min(max(value, -limit), limit)


@njit(cache=True, nogil=True)
def shortened(x: float, y: float, length: float) -> tuple[float, float]:
    """The vector, shortened to ``length`` if it is longer."""
    size = math.hypot(x, y)
    if size > length and size > 0.0:
        return x * length / size, y * length / size
    return x, y


@njit(cache=True, nogil=True)
def approach_rate(error: float, gain: float, acceleration: float, step_s: float) -> float:
    """Rate at which to reduce a non-negative error: proportional while it is small, square root beyond.

    With ``step_s`` > 0 one step does not overshoot.
    """
    if acceleration <= 0.0:
        rate = error * gain
    else:
        linear = acceleration / (gain * gain)
        rate = error * gain if error <= linear else math.sqrt(2.0 * acceleration * (error - 0.5 * linear))
    if step_s > 0.0:
        rate = min(rate, error / step_s)
    return rate


@njit(cache=True, nogil=True)
def approach_vector(x: float, y: float, gain: float, acceleration: float, step_s: float) -> tuple[float, float]:
    """``approach_rate`` along the direction of a vector error."""
    size = math.hypot(x, y)
    if size <= 0.0:
        return 0.0, 0.0
    rate = approach_rate(size, gain, acceleration, step_s)
    return x * rate / size, y * rate / size


@njit(cache=True, nogil=True)
def corner_limited(
    goal_n: float, goal_e: float, accel_n: float, accel_e: float, accel_max: float
) -> tuple[float, float]:
    """Acceleration limited in size, with some kept for turning across the direction of travel."""
    size = math.hypot(goal_n, goal_e)
    if size <= 0.0:
        return shortened(accel_n, accel_e, accel_max)
    along_n, along_e = goal_n / size, goal_e / size
    along = along_n * accel_n + along_e * accel_e
    cross_n, cross_e = accel_n - along_n * along, accel_e - along_e * along
    if abs(along) <= math.hypot(cross_n, cross_e):
        return shortened(accel_n, accel_e, accel_max)
    cross_n, cross_e = shortened(cross_n, cross_e, CORNER_SHARE * accel_max)
    room = math.sqrt(max(accel_max * accel_max - cross_n * cross_n - cross_e * cross_e, 0.0))
    along = limited(along, room)
    return cross_n + along_n * along, cross_e + along_e * along


@njit(cache=True, nogil=True)
def shaped_accel(
    error: Vector, speed: Vector, accel: Vector, limits: ShapingLimits, step_s: float
) -> tuple[float, float]:
    """The next acceleration of a target that is pulled to a place at rest; ``error``: metres to that place."""
    (error_n, error_e), (speed_n, speed_e), (accel_n, accel_e) = error, speed, accel
    speed_max, accel_max, jerk_max = limits
    gain = jerk_max / accel_max
    goal_n, goal_e = approach_vector(error_n, error_e, APPROACH_SHARE * gain, APPROACH_SHARE * accel_max, step_s)
    if speed_max > 0.0:
        goal_n, goal_e = shortened(goal_n, goal_e, speed_max)
    want_n, want_e = approach_vector(goal_n - speed_n, goal_e - speed_e, gain, jerk_max, step_s)
    want_n, want_e = corner_limited(goal_n, goal_e, want_n, want_e, accel_max)
    change_n, change_e = shortened(want_n - accel_n, want_e - accel_e, jerk_max * step_s)
    return accel_n + change_n, accel_e + change_e
