"""The cost of turning as weights in the planner's map: fields behind the rover cost more.

To go to a place behind it a rover stops and turns, which takes as long as driving several fields straight on. Without
this cost, two equally long paths round an obstacle make it turn back and forth with every new piece of wall that it
sees. A rover that cannot turn on the spot must drive even farther to turn round.
"""

from __future__ import annotations

import numpy as np

from companion.core.frames import Pose
from companion.core.grid import OBSTACLE, Grid
from companion.settings import GuidanceSettings

MAX_WEIGHT = 0.97
"""Costly, but never an obstacle."""
REACH_RADII = 3.0
"""For a rover that cannot turn on the spot the costly fields extend at least so many turning radii."""


def with_turning_cost(grid: Grid, pose: Pose, settings: GuidanceSettings, turning_radius_m: float = 0.0) -> Grid:
    """A copy of the grid where free fields behind the rover, up to ``turn_reach_m``, cost up to ``turn_cost`` more."""
    weights = grid.weights.copy()
    cell = grid.cell_at(pose.point)
    reach = round(grid.fields(max(settings.turn_reach_m, REACH_RADII * turning_radius_m)))
    rows = slice(max(0, cell.y - reach), max(0, cell.y + reach + 1))
    columns = slice(max(0, cell.x - reach), max(0, cell.x + reach + 1))
    window = weights[rows, columns]
    if window.size == 0:
        return grid.with_weights(weights)
    north = np.arange(rows.start, rows.start + window.shape[0])[:, None] - cell.y
    east = np.arange(columns.start, columns.start + window.shape[1])[None, :] - cell.x
    distance = np.hypot(north, east)
    forward = north * np.cos(pose.heading_rad) + east * np.sin(pose.heading_rad)
    behind = np.where(
        (distance > 0.0) & (distance <= reach), np.clip(-forward / np.maximum(distance, 1e-9), 0.0, 1.0), 0.0
    )
    raised = np.maximum(np.minimum(window + settings.turn_cost * behind, MAX_WEIGHT), window)
    weights[rows, columns] = np.where(window >= OBSTACLE, window, raised)
    return grid.with_weights(weights)
