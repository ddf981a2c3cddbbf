"""Blind behind: whether a rover that rolls back would do so over ground that no sensor ever saw.

Few rovers look back. One that came from there has seen the ground on its way; one that was begun, or turned on the
spot, has not.

Nouns: blind behind.
"""

from __future__ import annotations

import math

import numpy as np

from companion.control.local_view import LocalView

CREEPS_M_S = 0.1
"""No faster does it roll back there."""
BEHIND_M = 0.6
"""Looked at behind the tail: what it needs to stand from the fastest that it ever rolls back."""
MOST_UNSEEN = 0.1
"""A larger share of that ground is too much."""


def is_blind_behind(view: LocalView) -> bool:
    """Whether much of the ground as wide as the rover, up to ``BEHIND_M`` behind its tail, was never seen.

    What lies off the map counts as unseen.
    """
    evidence, pose, footprint = view.evidence, view.pose, view.footprint
    cell_m = evidence.evidence_m
    back_m = footprint.rear_m + np.arange(0.5 * cell_m, BEHIND_M, cell_m)[:, None]
    right_m = np.arange(0.5 * cell_m - footprint.half_width_m, footprint.half_width_m, cell_m)[None, :]
    sine, cosine = math.sin(pose.heading_rad), math.cos(pose.heading_rad)
    left_cells, low_cells = evidence.frame.xy(pose.point)
    x = np.floor(left_cells + (right_m * cosine - back_m * sine) / cell_m).astype(np.int64)
    y = np.floor(low_cells - (right_m * sine + back_m * cosine) / cell_m).astype(np.int64)
    height, width = evidence.log_odds.shape
    on_map = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    x, y = x.clip(0, width - 1), y.clip(0, height - 1)
    seen = on_map & ((evidence.log_odds[y, x] != 0.0) | (evidence.stamps[y, x] != 0))
    return bool(np.count_nonzero(~seen) > MOST_UNSEEN * seen.size)


def backwards_m_s(wanted_m_s: float, view: LocalView) -> float:
    """So fast it may roll back at most that is to roll back at this speed: where the ground is unseen it creeps."""
    return min(wanted_m_s, CREEPS_M_S) if is_blind_behind(view) else wanted_m_s
