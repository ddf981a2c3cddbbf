"""The known map, as it is told, and the shortest way of the footprint."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.core.frames import NedPoint
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import new_map, occupied_fields
from companion.settings import Settings
from sitl.experiments.driving import Series, together
from sitl.experiments.driving_bound import FIELD_M, shortest_ways_m
from sitl.experiments.driving_courses import CourseDrive, drive, tell
from sitl.generators.made_ground import made
from sitl.lockstep import DriveOutcome, Report
from sitl.scenario import SOMEWHERE
from sitl.world.truth import SimStart
from sitl.world.world import World

RADIUS_M = 0.35
WALL_EAST_M, GAP_M = 10.03, 14.0


def walled(resolution_m: float, thick_m: float, aside_m: float = 0.0) -> World:
    """20 m x 20 m with a wall across, open north of ``GAP_M``."""
    fields = np.zeros((round(20.0 / resolution_m),) * 2, np.bool_)
    first = round((WALL_EAST_M + aside_m) / resolution_m)
    fields[: round(GAP_M / resolution_m), first : first + max(1, round(thick_m / resolution_m))] = True
    return World(fields, resolution_m)


@pytest.mark.parametrize("aside_m", [0.0, 0.05, 0.1, 0.15, 0.2])
@pytest.mark.parametrize(("resolution_m", "thick_m"), [(0.1, 0.2), (0.1, 0.1), (0.5, 1.0), (1.0, 1.0)])
def test_past_a_wall_the_way_leads_round_its_end(resolution_m: float, thick_m: float, aside_m: float) -> None:
    world, start, target = walled(resolution_m, thick_m, aside_m), (5.0, 5.0), (5.0, 16.0)
    columns = np.flatnonzero(world.obstacles[0])
    corners = [(GAP_M, columns[0] * resolution_m), (GAP_M, (columns[-1] + 1) * resolution_m)]
    around = [NedPoint(*place) for place in (start, *corners, target)]
    taut_m = sum(one.distance_m(other) for one, other in pairwise(around))
    # A disc's middle passes round both corners on arcs: the wall's end as it is, and at each side a little more.
    turns_rad = [
        abs(one.bearing_rad(two) - two.bearing_rad(three))
        for one, two, three in zip(around, around[1:], around[2:], strict=False)
    ]
    exact_m = taut_m + sum(2.0 * RADIUS_M * math.tan(turn_rad / 4.0) for turn_rad in turns_rad)
    (way_m,) = shortest_ways_m(world, [start, target], RADIUS_M)
    assert taut_m - FIELD_M <= way_m <= exact_m + 2.0 * FIELD_M


@pytest.mark.parametrize("target", [(15.0, 5.0), (-7.0, 2.0), (60.0, 80.0)])
def test_where_nothing_stands_the_way_is_straight_beyond_the_world_as_well(target: tuple[float, float]) -> None:
    ways = shortest_ways_m(World.open(), [(5.0, 5.0), target, (5.0, 5.0)], RADIUS_M)
    assert ways == pytest.approx([math.dist((5.0, 5.0), target)] * 2, abs=FIELD_M)


def test_behind_walls_there_is_no_way() -> None:
    fields = np.ones((60, 60), np.bool_)
    fields[20:40, 20:40] = False
    fields[20:40, 30] = True
    world = World(fields, 0.1)
    (near_m, none_m) = shortest_ways_m(world, [(2.5, 2.5), (3.5, 2.5), (3.5, 3.5)], 0.2)
    assert near_m == pytest.approx(1.0, abs=0.15) and math.isnan(none_m)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["rooms", "maze", "yard"])
def test_no_wall_of_the_told_map_has_a_hole_and_beyond_it_nothing_is_known(kind: str, seed: int) -> None:
    ground = made(kind, seed)
    start = SimStart(*ground.start_m, math.pi / 2.0, SOMEWHERE)
    corner = NedPoint(-40.3 + 0.05 * seed, -20.1)
    evidence = new_map(empty_grid(170, 170, 0.5, corner), RADIUS_M, Settings().mapping)
    tell(evidence, ground.world, start)
    occupied = evidence.log_odds >= evidence.settings.occupied_at
    north, east = np.nonzero(ground.world.obstacles)
    rows, columns = (
        ((places + 0.5) * ground.world.resolution_m - begin_m - edge_m) / evidence.evidence_m
        for places, begin_m, edge_m in ((north, start.north_m, corner.north_m), (east, start.east_m, corner.east_m))
    )
    assert occupied[rows.astype(int), columns.astype(int)].all()
    inside = np.zeros_like(occupied)
    inside[
        math.floor(rows.min()) - 1 : math.ceil(rows.max()) + 2,
        math.floor(columns.min()) - 1 : math.ceil(columns.max()) + 2,
    ] = True
    assert not evidence.log_odds[~inside].any() and (evidence.log_odds < 0.0).sum() > 10_000


def test_on_fields_of_the_worlds_size_the_told_map_is_the_world() -> None:
    rng = np.random.default_rng(0)
    world = World(rng.uniform(size=(15, 24)) < 0.2)
    start = SimStart(7.5, 2.5, 0.0, SOMEWHERE)
    evidence = new_map(empty_grid(24, 15, 1.0, NedPoint(-7.5, -2.5)), RADIUS_M, Settings().mapping)
    tell(evidence, world, start)
    assert (occupied_fields(evidence) == world.obstacles).all()


def test_together_each_seed_counts_once_and_only_if_every_course_was_driven_to_its_end() -> None:
    def series(course: str, *times_s: float) -> Series:
        reports = (Report(0, DriveOutcome.REACHED, driving_time_s=one) for one in times_s)
        late = Report(0, DriveOutcome.TIME_LIMIT, driving_time_s=1800.0)
        return Series("hybrid", course, (*map(CourseDrive, reports), CourseDrive(late)))

    times_s = together([series("a", 10.0, 12.0, 14.0), series("b", 100.0, 110.0, 120.0)])
    assert times_s[:3].tolist() == [55.0, 61.0, 67.0] and math.isnan(times_s[3])
    assert series("a", 10.0).time_s == 10.0 and series("a", 10.0).missed == 1


@pytest.mark.thorough
def test_no_drive_beats_the_bound_and_on_the_known_map_it_is_nearer_to_it() -> None:
    unknown, known = drive("maze", "theta-star", 1), drive("maze", "theta-star", 1, known=True)
    assert known.bound_s is not None and unknown.bound_s is None
    assert known.bound_s < known.report.driving_time_s < 0.9 * unknown.report.driving_time_s
    assert known.report.drawn_ah < unknown.report.drawn_ah
