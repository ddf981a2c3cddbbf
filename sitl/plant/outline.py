"""Outline: how near the rover's outline, a circle or a rectangle, is to fields of obstacles and to moving discs.

Nouns: outline.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from sitl.world.movers import Fleet, motion_of
from sitl.world.world import FieldGrid, clearance_m


class Outline(NamedTuple):
    """A circle of ``radius_m``, or, if that is 0, a rectangle from ``rear_m`` behind to ``front_m`` ahead."""

    radius_m: float
    front_m: float = 0.0
    rear_m: float = 0.0
    half_width_m: float = 0.0

    @property
    def reach_m(self) -> float:
        """Radius of the circle that it lies in."""
        return self.radius_m or math.hypot(max(self.front_m, self.rear_m), self.half_width_m)


DISC = Outline(0.35)
"""That of a rover that nothing is said of."""


class OutlinePose(NamedTuple):
    """Where it is, world frame."""

    north_m: float
    east_m: float
    heading_rad: float


@njit(cache=True, nogil=True)
def room_m(grid: FieldGrid, outline: Outline, pose: OutlinePose, reach_m: float) -> float:
    """Metres from the outline to the nearest obstacle field, negative where they overlap, at most ``reach_m``.

    For a rectangle it is the gap along the one of four axes (its own two and the grid's) that parts them farthest: 0
    where they touch, and never more than the distance.
    """
    if outline.radius_m > 0.0:
        near_m = outline.radius_m + reach_m
        clear_m = clearance_m(grid, pose.north_m, pose.east_m, near_m)
        return reach_m if clear_m >= near_m else clear_m - outline.radius_m
    ahead_n, ahead_e = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    half_length_m, middle_m = 0.5 * (outline.front_m + outline.rear_m), 0.5 * (outline.front_m - outline.rear_m)
    half_width_m, half_field_m = outline.half_width_m, 0.5 * grid.resolution_m
    north_m, east_m = pose.north_m + middle_m * ahead_n, pose.east_m + middle_m * ahead_e
    along_n, along_e = abs(ahead_n), abs(ahead_e)
    turned_m = half_field_m * (along_n + along_e)
    extent_n = half_length_m * along_n + half_width_m * along_e
    extent_e = half_length_m * along_e + half_width_m * along_n
    height, width = grid.fields.shape
    low = max(0, math.floor((north_m - extent_n - reach_m - grid.south_m) / grid.resolution_m))
    high = min(height - 1, math.floor((north_m + extent_n + reach_m - grid.south_m) / grid.resolution_m))
    left = max(0, math.floor((east_m - extent_e - reach_m - grid.west_m) / grid.resolution_m))
    right = min(width - 1, math.floor((east_m + extent_e + reach_m - grid.west_m) / grid.resolution_m))
    nearest_m = reach_m
    for row in range(low, high + 1):
        to_n = grid.south_m + (row + 0.5) * grid.resolution_m - north_m
        for column in range(left, right + 1):
            if grid.fields[row, column]:
                to_e = grid.west_m + (column + 0.5) * grid.resolution_m - east_m
                ahead_m = abs(to_n * ahead_n + to_e * ahead_e) - half_length_m - turned_m
                aside_m = abs(to_e * ahead_n - to_n * ahead_e) - half_width_m - turned_m
                across_m = max(abs(to_n) - extent_n, abs(to_e) - extent_e) - half_field_m
                nearest_m = min(nearest_m, max(ahead_m, aside_m, across_m))
    return nearest_m


@njit(cache=True, nogil=True)
def mover_room_m(fleet: Fleet, outline: Outline, pose: OutlinePose, time_s: float) -> tuple[float, int]:
    """Metres from the outline to the nearest mover's edge (negative where they overlap) and its number; inf, -1."""
    ahead_n, ahead_e = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    nearest_m, which = math.inf, -1
    for mover in range(fleet.radii_m.size):
        north_m, east_m, _, _ = motion_of(fleet, mover, time_s)
        to_n, to_e = north_m - pose.north_m, east_m - pose.east_m
        if outline.radius_m > 0.0:
            gap_m = math.hypot(to_n, to_e) - outline.radius_m
        else:
            ahead_m, aside_m = to_n * ahead_n + to_e * ahead_e, abs(to_e * ahead_n - to_n * ahead_e)
            beyond_m = max(ahead_m - outline.front_m, -ahead_m - outline.rear_m)
            beside_m = aside_m - outline.half_width_m
            if beyond_m <= 0.0 and beside_m <= 0.0:
                gap_m = max(beyond_m, beside_m)
            else:
                gap_m = math.hypot(max(beyond_m, 0.0), max(beside_m, 0.0))
        gap_m -= fleet.radii_m[mover]
        if gap_m < nearest_m:
            nearest_m, which = gap_m, mover
    return nearest_m, which
