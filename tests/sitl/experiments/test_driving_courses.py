"""What nothing can beat: the shortest way of the footprint at cruise speed."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.core.frames import NedPoint
from sitl.experiments.driving_courses import FIELD_M, drive, shortest_way_m
from sitl.world.world import World

WALL_EAST_M, WALL_WIDE_M, GAP_M = 10.0, 1.0, 14.0


def walled(resolution_m: float = 0.5) -> World:
    """20 m x 20 m with a wall across, open north of ``GAP_M``."""
    fields = np.zeros((round(20.0 / resolution_m),) * 2, np.bool_)
    first = round(WALL_EAST_M / resolution_m)
    fields[: round(GAP_M / resolution_m), first : first + round(WALL_WIDE_M / resolution_m)] = True
    return World(fields, resolution_m)


def test_past_a_wall_the_way_leads_round_its_corners_and_no_longer() -> None:
    half_m, start, target = 0.35, (5.0, 5.0), (5.0, 16.0)
    corners = [(GAP_M, WALL_EAST_M), (GAP_M, WALL_EAST_M + WALL_WIDE_M)]
    around = [NedPoint(*place) for place in (start, *corners, target)]
    taut_m = sum(one.distance_m(other) for one, other in pairwise(around))
    way_m = shortest_way_m(walled(), [start, target], half_m)
    # A disc's middle passes the corners at most its radius farther out.
    assert taut_m - 2.0 * FIELD_M <= way_m <= taut_m + 2.0 * math.pi * half_m


@pytest.mark.parametrize("target", [(15.0, 5.0), (-7.0, 2.0), (60.0, 80.0)])
def test_where_nothing_stands_the_way_is_straight_beyond_the_world_as_well(target: tuple[float, float]) -> None:
    straight_m = math.dist((5.0, 5.0), target)
    assert shortest_way_m(World.open(), [(5.0, 5.0), target], 0.35) == pytest.approx(straight_m, abs=2.0 * FIELD_M)


def test_behind_walls_there_is_no_way() -> None:
    fields = np.zeros((40, 40), np.bool_)
    fields[:, 20] = True
    fields[0] = fields[-1] = fields[:, 0] = fields[:, -1] = True
    assert math.isfinite(shortest_way_m(World(fields, 0.5), [(5.0, 3.0), (8.0, 3.0)], 0.35))
    closed = World(np.pad(fields, 20, constant_values=True), 0.5, -10.0, -10.0)
    assert math.isnan(shortest_way_m(closed, [(5.0, 3.0), (5.0, 15.0)], 0.35))


@pytest.mark.thorough
def test_no_drive_beats_the_bound_and_on_the_known_map_it_is_nearer_to_it() -> None:
    unknown, known = drive("maze", "theta-star", 1), drive("maze", "theta-star", 1, known=True)
    assert known.bound_s is not None and unknown.bound_s is None
    assert known.bound_s < known.report.driving_time_s < 0.9 * unknown.report.driving_time_s
    assert known.report.drawn_ah < unknown.report.drawn_ah
