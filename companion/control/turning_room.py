"""Turning room: whether a rover that turns on the spot touches something with its outline.

Nouns: turning room.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.control.local_view import LocalView
from companion.core.footprint import Footprint
from companion.core.frames import wrap_pi_rad

STEP_RAD = 0.05
"""The outline is looked at so often."""
AWAY_M = 0.01
"""A rover whose outline lies over something may get so much deeper, so that it gets away."""


def may_turn_to(bearing_rad: float, view: LocalView) -> bool:
    """Whether the outline, turned the shorter way to a bearing, gets hardly deeper over anything than it is now."""
    footprint, pose = view.footprint, view.pose
    things = _around(view)
    if footprint.is_circle or len(things) == 0:
        return True
    turn_rad = wrap_pi_rad(bearing_rad - pose.heading_rad)
    turned_rad = pose.heading_rad + np.linspace(0.0, turn_rad, 2 + math.ceil(abs(turn_rad) / STEP_RAD))
    deepest_m = np.array([_inside_m(things, heading_rad, footprint).max() for heading_rad in turned_rad])
    return bool(deepest_m.max() <= max(deepest_m[0] + AWAY_M, 0.0))


def _around(view: LocalView) -> NDArray[np.float64]:
    """Middles of occupied cells within the rover's reach; shape (n, 2), metres north and east of the rover."""
    evidence, pose = view.evidence, view.pose
    cell_m, corner = evidence.evidence_m, evidence.base.south_west
    north_m, east_m = pose.north_m - corner.north_m, pose.east_m - corner.east_m
    reach_m = view.footprint.radius_m
    low_y, low_x = (max(math.floor((v - reach_m) / cell_m), 0) for v in (north_m, east_m))
    high_y, high_x = (max(math.ceil((v + reach_m) / cell_m), 0) for v in (north_m, east_m))
    cells = np.argwhere(evidence.log_odds[low_y:high_y, low_x:high_x] >= evidence.settings.occupied_at)
    middles_m = (cells + np.array((low_y, low_x)) + 0.5) * cell_m
    return np.asarray(middles_m - np.array((north_m, east_m)), dtype=np.float64)


def _inside_m(things: NDArray[np.float64], heading_rad: float, outline: Footprint) -> NDArray[np.float64]:
    """How deep each of them lies in the outline of a rover with this heading; below 0 outside."""
    sine, cosine = math.sin(heading_rad), math.cos(heading_rad)
    forward_m, right_m = things @ (cosine, sine), things @ (-sine, cosine)
    ahead_m, behind_m = outline.front_m - forward_m, outline.rear_m + forward_m
    deep_m: NDArray[np.float64] = np.minimum.reduce([ahead_m, behind_m, outline.half_width_m - np.abs(right_m)])
    return deep_m
