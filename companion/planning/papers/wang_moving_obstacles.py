"""When a robot on a straight line first meets a moving obstacle (Wang et al. 2007, II.A). Compiled.

The paper takes the point where the robot's line crosses the obstacle's trajectory, and tests whether the obstacle's
exclusion area covers it when the robot arrives. Here the robot's line is taken in the obstacle's frame, where it is
straight while neither turns, and clipped with the exclusion area itself. So the first meeting is found exactly, also
where there is no crossing point: head on, overtaking, or with an obstacle that stands still. In the code a moving
obstacle is a *mover*.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.problem import ObstacleTrajectory

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Fleet(NamedTuple):
    """All moving obstacles: their tracks joined (columns time, x, y), where each begins, radii and safety margins.

    ``shares``: the share of the margins that is kept for each obstacle; see ``fit_shares``.
    """

    rows: Floats
    begins: Ints
    radii: Floats
    shares: Floats
    safe_fields: float
    timing_s: float


class Stretch(NamedTuple):
    """A robot on a straight line at a constant speed, from (x, y) at ``begin_s`` until ``end_s``."""

    begin_s: float
    end_s: float
    x: float
    y: float
    speed_x: float
    speed_y: float


def fleet_of(movers: tuple[ObstacleTrajectory, ...], safe_fields: float, timing_s: float) -> Fleet:
    """The moving obstacles for the kernels, with full margins."""
    movers = tuple(mover for mover in movers if len(mover.track))
    rows = [np.asarray(mover.track, np.float64) for mover in movers]
    begins = np.cumsum([0, *(len(track) for track in rows)])
    radii = np.array([mover.radius_fields for mover in movers], np.float64)
    joined = np.concatenate(rows) if rows else np.empty((0, 3))
    return Fleet(np.ascontiguousarray(joined), begins, radii, np.ones(len(movers)), safe_fields, timing_s)


@njit(cache=True, nogil=True)
def place(fleet: Fleet, mover: int, time_s: float) -> tuple[float, float, float, float, float]:
    """A mover's place, x and y, its speed along x and y, and until when that speed stays the same."""
    low, high = fleet.begins[mover], fleet.begins[mover + 1] - 1
    rows = fleet.rows
    if time_s < rows[low, 0]:
        return rows[low, 1], rows[low, 2], 0.0, 0.0, rows[low, 0]
    if time_s >= rows[high, 0]:
        return rows[high, 1], rows[high, 2], 0.0, 0.0, np.inf
    while high - low > 1:
        middle = (low + high) // 2
        if rows[middle, 0] <= time_s:
            low = middle
        else:
            high = middle
    span = rows[high, 0] - rows[low, 0]
    speed_x, speed_y = (rows[high, 1] - rows[low, 1]) / span, (rows[high, 2] - rows[low, 2]) / span
    since = time_s - rows[low, 0]
    return rows[low, 1] + speed_x * since, rows[low, 2] + speed_y * since, speed_x, speed_y, rows[high, 0]


@njit(cache=True, nogil=True)
def exclusion(fleet: Fleet, mover: int, mover_speed: float, robot_speed: float) -> tuple[float, float]:
    """Half length (along the mover's heading) and half width of its exclusion area, an ellipse.

    It extends beyond the mover by the safe distance and by timing margins: along its heading by what the mover covers
    in ``timing_s``, as it may be early or late; across it by what the robot covers in that time.
    """
    radius, share = fleet.radii[mover], fleet.shares[mover]
    if mover_speed == 0.0:
        return radius + share * fleet.safe_fields, radius + share * fleet.safe_fields
    length = radius + share * (fleet.safe_fields + fleet.timing_s * mover_speed)
    return length, radius + share * (fleet.safe_fields + fleet.timing_s * robot_speed)


@njit(cache=True, nogil=True)
def first_inside(x: float, y: float, along_x: float, along_y: float, duration: float) -> float:
    """When a point of constant velocity first enters the unit circle round the origin; inf: not within the duration."""
    inside = x * x + y * y - 1.0
    if inside < 0.0:
        return 0.0
    speed2 = along_x * along_x + along_y * along_y
    towards = x * along_x + y * along_y
    if towards >= 0.0:
        return np.inf
    root = towards * towards - speed2 * inside
    if root <= 0.0:
        return np.inf
    when = (-towards - math.sqrt(root)) / speed2
    return when if when < duration else np.inf


@njit(cache=True, nogil=True)
def first_meeting(fleet: Fleet, mover: int, stretch: Stretch) -> float:
    """When a robot first is in a mover's exclusion area; inf: not on this stretch."""
    time_s, end_s, x, y, speed_x, speed_y = stretch
    robot_speed = math.hypot(speed_x, speed_y)
    while True:
        mover_x, mover_y, mover_vx, mover_vy, change_s = place(fleet, mover, time_s)
        mover_speed = math.hypot(mover_vx, mover_vy)
        length, width = exclusion(fleet, mover, mover_speed, robot_speed)
        ux, uy = (mover_vx / mover_speed, mover_vy / mover_speed) if mover_speed > 0.0 else (1.0, 0.0)
        dx, dy, vx, vy = x - mover_x, y - mover_y, speed_x - mover_vx, speed_y - mover_vy
        duration = min(change_s, end_s) - time_s
        when = first_inside(
            (dx * ux + dy * uy) / length,
            (dy * ux - dx * uy) / width,
            (vx * ux + vy * uy) / length,
            (vy * ux - vx * uy) / width,
            duration,
        )
        if when < np.inf:
            return time_s + when
        if change_s >= end_s:
            return np.inf
        time_s, x, y = change_s, x + speed_x * duration, y + speed_y * duration


@njit(cache=True, nogil=True)
def fit_shares(fleet: Fleet, x: float, y: float, top_speed: float) -> None:
    """Shrink the margins of movers whose exclusion area the robot is in already; their radii stay."""
    stretch = Stretch(0.0, 1e-9, float(x), float(y), 0.0, top_speed)
    for mover in range(len(fleet.radii)):
        while fleet.shares[mover] > 0.0 and first_meeting(fleet, mover, stretch) < np.inf:
            fleet.shares[mover] = max(fleet.shares[mover] - 0.125, 0.0)
