"""What a turn of a lidar costs the map: 720 rays in a round room (``make bench``)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from companion.core.frames import Pose
from companion.core.grid import empty_grid
from companion.core.scan import WIRED, RangeScan
from companion.mapping.evidence_map import integrate, new_map
from companion.settings import MappingSettings

RAYS = 720
AIM_MS, MOST_MS = 1.0, 1.5
"""A busy machine needs half as much again."""
SIDE_M, RADIUS_M, REACH_M = 40.0, 0.35, 12.0
MOTIONS = {"evidence_m": 0.1, "hit_depth_m": 0.02, "keeps": "outline"}
KINDS = {"fields of 1 m": (1.0, {}), "fields of 0.15 m": (0.15, {}), "planned motions": (0.15, MOTIONS)}


@pytest.mark.parametrize("wall_m", [4.0, 8.0, math.inf])
@pytest.mark.parametrize("kind", KINDS)
def test_a_turn_is_mapped(benchmark, kind: str, wall_m: float) -> None:
    """The rover moves and turns a little between turns, as it drives; the wall is noisy by 2 cm."""
    field_m, settings = KINDS[kind]
    cells = int(SIDE_M / field_m)
    evidence = new_map(empty_grid(cells, cells, field_m), RADIUS_M, MappingSettings.model_validate(settings))
    chance, numbers = np.random.default_rng(1), itertools.count(1)
    bearing_rad = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)

    def turn() -> tuple[tuple[object, ...], dict[str, object]]:
        number = next(numbers)
        range_m = wall_m + chance.normal(0.0, 0.02, RAYS)
        scan = RangeScan(0.1 * number, bearing_rad, range_m, 0.05, REACH_M, 2.0 * math.pi / RAYS, "lidar", WIRED)
        middle_m = 0.5 * SIDE_M
        pose = Pose(middle_m + 0.01 * (number % 50), middle_m, 0.02 * number, 0.1 * number)
        return (evidence, pose, scan, number), {}

    benchmark.pedantic(integrate, setup=turn, rounds=300, iterations=1, warmup_rounds=20)
    median_ms = 1e3 * benchmark.stats.stats.median
    print(f"\n{kind}, wall at {wall_m:g} m: {median_ms:.2f} ms a turn of {RAYS} rays (aim: {AIM_MS:g})")
    assert median_ms < MOST_MS
