"""Compiles every hot loop before the rover may move, so that no compilation falls into a drive."""

from __future__ import annotations

import gc

import numpy as np

from companion.frames import NedPoint, Pose
from companion.grid import empty_grid
from companion.mapping import clearance_m, integrate, look_along, new_map, penalise, unseen_beside
from companion.planning import registry
from companion.scan import RangeScan
from companion.settings import Settings


def warm_up(settings: Settings) -> None:
    """Run every compiled kernel once, with the types that a drive uses."""
    registry.warm_up()
    evidence = new_map(empty_grid(8, 8), 0.35, settings.mapping)
    bearings = np.array([0.0, 0.5])
    scan = RangeScan(0.0, bearings, np.array([2.0, np.inf]), 0.2, 4.0, 0.1, "warm-up")
    integrate(evidence, Pose(4.0, 4.0, 0.0, 0.0), scan, 1)
    penalise(evidence, evidence.base.cell_at(NedPoint(1.0, 1.0)), 0.1)
    look_along(evidence, NedPoint(4.0, 4.0), NedPoint(6.0, 4.0), 0.5)
    unseen_beside(evidence, NedPoint(4.0, 4.0), NedPoint(6.0, 4.0), 0.3, 0.5)
    clearance_m(evidence, NedPoint(4.0, 4.0), 1.0)
    # What lives now lives to the end: a collection that walks through it would stall a tick for a tenth of a second.
    gc.collect()
    gc.freeze()
