"""Rays of the simulated range sensors as they are drawn: how far each reaches now, without noise and drop-outs.

Nouns: true rays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.range_sensors import SensorSuite
from sitl.simulator import Simulator

FAN, STEP_DEG, HALF_BEAM_DEG = 180, 2.0, 2.0
"""Rays all round, for sensors that look into a few directions only; a beam is drawn so wide to each side."""

Json = dict[str, Any]


def rays_of(simulator: Simulator) -> Json | None:
    """For a frame; None without sensors, and while one of them has a fault."""
    sensing, truth = simulator.vehicle.sensing, simulator.truth
    suite = sensing.suite
    if sensing.lidar_fault is not None or sensing.beam_faults or (suite.lidar is None and not suite.beams):
        return None
    bearings, first, step, far_m = _bearings(suite)
    rows = np.flatnonzero(np.isfinite(bearings[:, 0]))
    seen = np.ascontiguousarray(bearings[rows]) + truth.heading_rad
    lengths_m = simulator.world.rays_m(truth.north_m, truth.east_m, seen, far_m, simulator.time_s)
    metres: list[float | None] = [None] * len(bearings)
    for row, length_m in zip(rows.tolist(), lengths_m.tolist(), strict=True):
        metres[row] = round(length_m, 2)
    return {"from": round(first, 4), "step": round(step, 5), "m": metres, "max_m": round(far_m, 2), "age_s": 0.0}


def _bearings(suite: SensorSuite) -> tuple[NDArray[np.float64], float, float, float]:
    """Rays from straight ahead, shape (directions, rays), NaN where no sensor looks; first, step, range."""
    if suite.lidar is not None:
        lidar = suite.lidar
        return lidar.bearings_rad(), math.radians(lidar.offset_deg), math.radians(lidar.increment_deg), lidar.max_m
    fan = np.full((FAN, 1), math.nan)
    at_deg = np.arange(FAN) * STEP_DEG
    level = [beam for beam in suite.beams if beam.fixed_m is None]
    for beam in level:
        off_deg = np.abs((at_deg - 45.0 * beam.orientation + 180.0) % 360.0 - 180.0)
        looks = off_deg <= max(0.5 * beam.width_deg, HALF_BEAM_DEG)
        fan[looks, 0] = np.radians(at_deg[looks])
    return fan, 0.0, math.radians(STEP_DEG), max((beam.max_m for beam in level), default=0.0)
