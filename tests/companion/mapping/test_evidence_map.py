"""From ranges to weights: posts with exact ray casting around a rover that looks at them."""

from __future__ import annotations

import math
import mmap
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core.frames import NedPoint, Pose
from companion.core.grid import BASE_WEIGHT, Cell, Grid, empty_grid
from companion.core.scan import WIRED, RangeScan
from companion.mapping.evidence_kernels import soften, weigh, weigh_roomy
from companion.mapping.evidence_map import MAX_SOFT_WEIGHT, EvidenceMap, integrate, new_map, penalise
from companion.mapping.map_edits import forget, forget_weak_evidence, look_again, move, rebase, restore, shifted
from companion.mapping.map_queries import clearance_m, known_fields, look_along, occupied_fields
from companion.mapping.sensor_agreement import BELIEVED_S
from companion.settings import MappingSettings

SETTINGS = MappingSettings()
RADIUS_M = 0.35
MAX_M = 8.0
FULL_CIRCLE = np.radians(np.arange(0.0, 360.0, 5.0))
WIDTH_RAD = math.radians(5.0)

Post = tuple[float, float, float]
"""A round post: north, east, radius; metres."""


def ranges(pose: Pose, posts: list[Post], bearing_rad: np.ndarray) -> np.ndarray:
    """Exact ranges to the nearest post along each bearing; inf beyond the sensor's reach."""
    result = np.full(len(bearing_rad), np.inf)
    angle = pose.heading_rad + bearing_rad
    for north_m, east_m, radius_m in posts:
        dn, de = north_m - pose.north_m, east_m - pose.east_m
        along = dn * np.cos(angle) + de * np.sin(angle)
        off = radius_m**2 - (dn**2 + de**2 - along**2)
        hit = np.where((off >= 0.0) & (along > 0.0), along - np.sqrt(np.maximum(off, 0.0)), np.inf)
        result = np.minimum(result, hit)
    return np.where(result < MAX_M, result, np.inf)


def scan(range_m: np.ndarray, bearing_rad: np.ndarray = FULL_CIRCLE, width_rad: float = WIDTH_RAD) -> RangeScan:
    return RangeScan(0.0, bearing_rad, np.asarray(range_m, np.float64), 0.1, MAX_M, width_rad, "test")


def sectors(pose: Pose, posts: list[Post]) -> RangeScan:
    """72 sectors of 5 degrees, each the nearest of nine rays, as a scanning lidar gives them."""
    spread = (np.arange(9) / 8.0 - 0.5) * WIDTH_RAD
    rays = ranges(pose, posts, (FULL_CIRCLE[:, None] + spread[None, :]).ravel())
    return scan(rays.reshape(len(FULL_CIRCLE), 9).min(axis=1))


class Ground:
    """A map, and a rover that looks round on it."""

    def __init__(self, base: Grid | None = None, radius_m: float = RADIUS_M) -> None:
        self.map: EvidenceMap = new_map(empty_grid(30, 20) if base is None else base, radius_m, SETTINGS)
        self.stamp = 0

    def take(self, pose: Pose, reading: RangeScan, times: int = 1) -> None:
        for _ in range(times):
            self.stamp += 1
            integrate(self.map, pose, reading, self.stamp)

    def look_round(self, pose: Pose, posts: list[Post], times: int = 1) -> None:
        self.take(pose, sectors(pose, posts), times)

    def obstacles(self) -> set[tuple[int, int]]:
        return {(int(x), int(y)) for y, x in np.argwhere(self.map.grid.weights >= 1.0)}


HERE = Pose(10.5, 10.5, 0.0, 0.0)


@pytest.mark.parametrize("often", [1, 40])
def test_a_sensor_that_sees_nothing_does_not_outvote_one_that_sees_something(often):
    """At ten scans a second of the one and any number of another; when the one falls silent, the other is believed."""
    ground, ahead = Ground(), np.zeros(1)
    nothing = replace(scan(np.array([np.inf]), ahead), sender=158)
    ground.take(HERE, nothing, times=often)
    for i in range(30):
        ground.take(HERE, replace(scan(np.array([4.0]), ahead), time_s=0.1 * i))
        ground.take(HERE, replace(nothing, time_s=0.1 * i + 0.05), times=often)
        assert i < 5 or (10, 14) in ground.obstacles()
    ground.take(HERE, replace(nothing, time_s=2.9 + BELIEVED_S + 0.01), times=40)
    assert (10, 14) not in ground.obstacles()


def test_a_sensor_frees_at_once_where_it_saw_something_itself():
    ground, ahead = Ground(), np.zeros(1)
    ground.take(HERE, scan(np.array([4.0]), ahead), times=3)
    ground.take(HERE, scan(np.array([np.inf]), ahead), times=12)
    assert (10, 14) not in ground.obstacles()


def test_what_a_moved_map_forgets_it_does_not_keep_from_being_freed():
    ground, ahead = Ground(), np.zeros(1)
    ground.take(HERE, scan(np.array([4.0]), ahead), times=3)
    forget(ground.map)
    ground.take(HERE, replace(scan(np.array([np.inf]), ahead), sender=158))
    assert known_fields(ground.map)[11:18, 10].all() and not (ground.map.log_odds > 0.0).any()


def test_what_is_seen_beyond_the_map_is_nobodys_cell():
    ground, round_about = Ground(empty_grid(3, 3)), np.radians([0.0, 90.0, 180.0, 270.0])
    for sender in (1, 158):
        ground.take(Pose(1.5, 1.5, 0.3, 0.0), replace(scan(np.full(4, 5.0), round_about), sender=sender))
    assert known_fields(ground.map).any() and not (ground.map.log_odds > 0.0).any()


@pytest.mark.parametrize("heading_deg", [0.0, 45.0, 90.0, 180.0, -135.0])
@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, -40.0])
@pytest.mark.parametrize("corner", [NedPoint(0.0, 0.0), NedPoint(-200.0, 300.0), NedPoint(-10.25, -10.75)])
def test_a_reading_hardens_the_field_it_ends_in(heading_deg, bearing_deg, corner):
    ground = Ground(empty_grid(21, 21, 1.0, corner))
    pose = Pose(corner.north_m + 10.5, corner.east_m + 10.5, math.radians(heading_deg), 0.0)
    bearing = np.radians([bearing_deg])
    ground.take(pose, scan(np.array([5.0]), bearing), times=3)
    end = pose.point.moved(pose.heading_rad + bearing[0], 5.0 + SETTINGS.hit_depth_m)
    field = ground.map.base.cell_at(end)
    assert ground.map.grid.is_obstacle(field)
    for x, y in ground.obstacles():
        assert abs(x - field.x) <= 1 and abs(y - field.y) <= 1, "only it and what the rover's radius adds"


def test_readings_free_the_ground_they_passed_and_unknown_ground_keeps_its_weight():
    ground = Ground()
    ground.take(HERE, scan(np.array([4.0]), np.zeros(1)), times=2)
    known = known_fields(ground.map)
    assert known[11:14, 10].all() and not known[17:, :].any() and not known[:, 15:].any()
    assert (ground.map.grid.weights[~known & (ground.map.grid.weights < 1.0)] >= BASE_WEIGHT).all()
    assert not {(10, 11), (10, 12)} & ground.obstacles()


def test_nothing_seen_frees_up_to_the_sensors_reach_and_nan_says_nothing():
    ground = Ground()
    ground.take(HERE, scan(np.array([np.inf, np.nan]), np.array([0.0, math.pi / 2])))
    known = known_fields(ground.map)
    assert known[11:18, 10].all() and not known[19, 10]
    assert not known[10, 13:].any()
    assert not ground.obstacles()


def test_the_map_without_evidence_is_the_mission_s():
    base = empty_grid(6, 6)
    base.weights[2, 3], base.weights[4, 0] = 1.0, 0.1
    ground = Ground(base)
    assert ground.obstacles() == {(3, 2)} and not known_fields(ground.map).any()
    assert base.weights[2, 3] == 1.0 and base.weights.sum() == pytest.approx(34 * 0.5 + 1.1), "the base is only read"


def test_obstacles_that_disappear_are_forgotten():
    ground = Ground()
    post = (15.5, 10.5, 0.3)
    ground.look_round(HERE, [post], times=200)
    assert (10, 15) in ground.obstacles()
    looks = 0
    while ground.obstacles() and looks < 50:
        ground.look_round(HERE, [])
        looks += 1
    assert 3 <= looks <= 20, "after a second or two, not after the first miss"


def test_obstacles_that_appear_on_ground_long_seen_free_are_seen_at_once():
    ground = Ground()
    ground.look_round(HERE, [], times=200)
    ground.look_round(HERE, [(13.5, 10.5, 0.3)], times=4)
    assert (10, 13) in ground.obstacles()


def test_what_the_mission_closed_is_never_forgotten():
    base = empty_grid(30, 20)
    base.weights[13, 8:13] = 1.0
    ground = Ground(base)
    ground.look_round(HERE, [], times=100)
    forget(ground.map)
    forget_weak_evidence(ground.map, HERE.point, 10.0)
    assert {(x, 13) for x in range(8, 13)} <= ground.obstacles()


@pytest.mark.parametrize("radius_m", [0.02, 0.05])
@pytest.mark.parametrize("distance_m", [3.0, 5.0])
def test_a_thin_post_is_not_outvoted_by_the_free_ground_round_it(radius_m, distance_m):
    """It stands in one of many beams that pass; seen from many places it must stay, in every one of them."""
    ground = Ground()
    post = (10.5 + distance_m, 10.5, radius_m)
    lost = 0
    for i in range(120):
        pose = Pose(10.5, 10.5 + 0.5 * math.sin(i / 7.0), 0.02 * i, 0.0)
        ground.look_round(pose, [post])
        if i > 5:
            lost += (10, int(post[0])) not in ground.obstacles()
    assert lost == 0


def known_from_m(seed: int, noise_m: float, confirm_m: float) -> float:
    """How far before a post of 4 cm a rover that comes at 2 m/s has it on the map for the first time."""
    rng, post = np.random.default_rng(seed), (11.5, 11.05, 0.02)
    evidence = new_map(empty_grid(30, 20), RADIUS_M, MappingSettings(evidence_m=0.05, confirm_m=confirm_m))
    for i in range(46):
        pose = Pose(2.0 + 0.2 * i, 10.5, 0.0, 0.0)
        reading = sectors(pose, [post]).range_m + rng.normal(0.0, noise_m, len(FULL_CIRCLE))
        integrate(evidence, pose, replace(scan(reading), time_s=0.1 * i), i + 1)
        y, x = np.nonzero(evidence.log_odds >= SETTINGS.occupied_at)
        if (np.hypot((y + 0.5) * 0.05 - post[0], (x + 0.5) * 0.05 - post[1]) < 0.3).any():
            return post[0] - pose.north_m
    return 0.0


@pytest.mark.parametrize("noise_m", [0.02, 0.075])
def test_a_thin_post_on_ground_seen_free_is_known_from_afar_also_to_a_noisy_sensor(noise_m: float) -> None:
    """Over 20 seeds in nine of ten; often far later where no reading confirms another."""
    known_m = np.array([known_from_m(seed, noise_m, SETTINGS.confirm_m) for seed in range(20)])
    alone_m = np.array([known_from_m(seed, noise_m, 0.0) for seed in range(20)])
    assert np.quantile(known_m, 0.1) > 6.0
    assert np.quantile(alone_m, 0.25) < (5.0 if noise_m < 0.05 else 1.5)


def test_random_readings_leave_no_ghosts():
    """One reading in fifty is wrong and too short, and all are noisy by 3 cm, for a minute while the rover drives."""
    rng = np.random.default_rng(7)
    posts = [(5.5, 4.5, 0.4), (14.5, 9.5, 0.4), (6.5, 15.5, 0.4), (13.5, 20.5, 0.4), (8.5, 25.5, 0.4)]
    ground = Ground()
    ghosts = []
    for i in range(600):
        pose = Pose(10.0 + math.sin(i / 90.0), 4.0 + i / 30.0, math.pi / 2, 0.0)
        reading = sectors(pose, posts).range_m + rng.normal(0.0, 0.03, len(FULL_CIRCLE))
        wrong = rng.random(len(reading)) < 0.02
        reading[wrong] = rng.uniform(0.2, MAX_M, wrong.sum())
        ground.take(pose, replace(scan(reading), time_s=0.1 * i))
        ghosts.append(len([c for c in ground.obstacles() if not near_a_post(c, posts)]))
    # 600 scans have some 860 wrong readings, and the map some 500 fields in sight.
    assert np.mean(ghosts) < 3.0, "few at any moment"
    for _ in range(25):
        ground.look_round(pose, posts)
    in_sight = [c for c in ground.obstacles() if not near_a_post(c, posts) and abs(c[0] - pose.east_m) < 5]
    assert not in_sight, "and none that lasts"


def near_a_post(field: tuple[int, int], posts: list[Post]) -> bool:
    """Whether rover and post could touch, or the field is beside one that they could touch in."""
    return any(math.hypot(field[1] + 0.5 - n, field[0] + 0.5 - e) < r + RADIUS_M + 0.8 for n, e, r in posts)


@pytest.mark.parametrize("wide_sectors", [False, True])
def test_noise_does_not_fill_the_free_side_of_a_wall(wide_sectors):
    """A wall 10 cm behind a field's edge, 300 scans with 3 cm of noise: the fields before it stay free.

    A sector of 5 degrees gives the nearest of what it sees, so aslant a wall seems nearer, but not by a whole field.
    """
    rng = np.random.default_rng(3)
    wall = [(14.1 + 0.5, 6.5 + 0.1 * i, 0.5) for i in range(81)]
    ground = Ground(radius_m=0.3)
    truth = sectors(HERE, wall).range_m if wide_sectors else ranges(HERE, wall, FULL_CIRCLE)
    for _ in range(300):
        ground.take(HERE, scan(truth + rng.normal(0.0, 0.03, len(truth))))
    assert {(8, 14), (10, 14), (12, 14)} <= ground.obstacles()
    assert {y for _, y in ground.obstacles()} <= ({13, 14} if wide_sectors else {14})
    free_side = look_along(ground.map, HERE.point, NedPoint(14.5, 10.5), 0.0).clear_m
    assert free_side > 14.1 - HERE.north_m - 0.3


@pytest.mark.parametrize("bearing_rad", [FULL_CIRCLE, -FULL_CIRCLE], ids=["clockwise", "counter-clockwise"])
@pytest.mark.parametrize("phase_deg", [0.0, 1.0, 2.5, 4.0])
@pytest.mark.parametrize("aside_m", [1.0, 2.2, 3.4])
def test_a_wall_along_which_wide_beams_look_is_not_freed_between_their_ends(aside_m, phase_deg, bearing_rad):
    """Ends of beams of 5 degrees lie up to a metre apart there, and a beam frees ground on both sides of its middle."""
    evidence, east_m = new_map(empty_grid(30, 20), RADIUS_M, SETTINGS), 10.0 + aside_m
    for step in range(40):
        pose = Pose(8.0 + 0.2 * step, 10.0, math.radians(phase_deg), 0.1 * step)
        sine = np.sin(pose.heading_rad + bearing_rad)
        range_m = np.where(sine > 1e-6, aside_m / np.maximum(sine, 1e-6), np.inf)
        integrate(evidence, pose, scan(np.where(range_m < MAX_M, range_m, np.inf), bearing_rad), step + 1)
    inside = int(east_m * evidence.subdivisions) + 2
    assert (evidence.log_odds[:, inside:] >= 0.0).all()
    assert (evidence.log_odds[8 * evidence.subdivisions : 16 * evidence.subdivisions, inside - 4] < 0.0).all()


def test_a_range_of_nothing_is_no_error():
    evidence = new_map(empty_grid(10, 10), RADIUS_M, SETTINGS)
    beams = np.radians([-5.0, 0.0, 5.0])
    integrate(evidence, Pose(5.0, 5.0, 0.0, 0.0), scan(np.array([0.0, 1.0, 3.0]), beams), 1)
    assert np.isfinite(evidence.log_odds).all()


def test_the_field_under_the_rover_is_free():
    ground = Ground()
    ground.take(HERE, scan(np.full(len(FULL_CIRCLE), 0.15)), times=20)
    assert (10, 10) not in ground.obstacles(), "readings of its own body"
    ground.look_round(Pose(10.5, 14.5, 0.0, 0.0), [(10.5, 10.4, 0.1)], times=20)
    assert (10, 10) in ground.obstacles()
    ground.take(HERE, scan(np.full(len(FULL_CIRCLE), np.inf)))
    assert (10, 10) not in ground.obstacles(), "where it stands nothing else can stand"


@pytest.mark.parametrize(("radius_m", "closed"), [(0.3, False), (0.9, True)])
def test_fields_too_narrow_for_the_rover_are_closed(radius_m, closed):
    """A post 0.15 m behind the edge of the next field: a small rover fits into the middle of the field before it."""
    ground = Ground(radius_m=radius_m)
    ground.look_round(HERE, [(14.2, 10.5, 0.05)], times=10)
    assert (10, 14) in ground.obstacles()
    assert ((10, 13) in ground.obstacles()) is closed


def test_ground_beside_obstacles_costs_more_and_less_so_with_distance():
    ground = Ground()
    ground.look_round(HERE, [(15.5, 10.5, 0.4)], times=10)
    beside, next_to_it, far = (ground.map.grid.weights[y, 10] for y in (14, 13, 11))
    assert 1.0 > beside > next_to_it > far == BASE_WEIGHT


def test_penalties_add_up_to_an_obstacle_and_can_be_forgotten():
    ground = Ground()
    field = Cell(12, 12)
    penalise(ground.map, field, 0.2)
    assert ground.map.grid.weights[12, 12] == pytest.approx(0.7)
    penalise(ground.map, field, 0.4)
    assert ground.map.grid.is_obstacle(field)
    penalise(ground.map, Cell(-1, 99), 1.0)
    forget(ground.map)
    assert (ground.map.grid.weights == BASE_WEIGHT).all() and not known_fields(ground.map).any()


def test_doubt_forgets_weak_evidence_anywhere_and_strong_evidence_nearby():
    far, near, weak = (17.5, 10.5, 0.3), (10.5, 12.5, 0.3), (10.5, 4.5, 0.3)
    ground = Ground()
    ground.look_round(HERE, [far, near], times=30)
    ground.look_round(HERE, [far, near, weak], times=3)
    assert {(10, 17), (12, 10), (4, 10)} <= ground.obstacles()
    assert forget_weak_evidence(ground.map, HERE.point, 3.0)
    assert (10, 17) in ground.obstacles() and not {(12, 10), (4, 10)} & ground.obstacles()
    forget(ground.map)
    assert not forget_weak_evidence(ground.map, HERE.point, 3.0), "nothing left to doubt"


# --- along a line ----------------------------------------------------------------------------------------------------


def test_look_along_ends_before_the_obstacle_and_where_nothing_has_been_seen():
    ground = Ground()
    ground.look_round(HERE, [(15.5, 10.5, 0.4)], times=10)
    line = look_along(ground.map, HERE.point, NedPoint(19.5, 10.5), RADIUS_M)
    assert 15.1 - 10.5 - RADIUS_M - 0.4 < line.clear_m <= 15.1 - 10.5 - RADIUS_M + 0.05
    free = look_along(ground.map, HERE.point, NedPoint(10.5, 17.5), RADIUS_M)
    assert free.clear_m == pytest.approx(7.0) and free.seen_m == pytest.approx(7.0)
    beyond = look_along(ground.map, HERE.point, NedPoint(10.5, 29.0), RADIUS_M)
    assert MAX_M - 0.6 < beyond.seen_m < MAX_M + 0.3


def test_look_along_counts_what_stands_beside_the_line():
    ground = Ground()
    ground.look_round(HERE, [(14.5, 11.4, 0.2)], times=10)
    ahead = NedPoint(18.0, 10.5)
    assert look_along(ground.map, HERE.point, ahead, 0.3).clear_m == pytest.approx(7.5)
    assert look_along(ground.map, HERE.point, ahead, 1.0).clear_m < 4.0


def test_look_along_respects_fences_and_penalties():
    base = empty_grid(30, 20)
    base.weights[14, 10] = 1.0
    ground = Ground(base)
    penalise(ground.map, Cell(14, 10), 1.0)
    assert look_along(ground.map, HERE.point, NedPoint(18.5, 10.5), 0.3).clear_m == pytest.approx(3.5, abs=0.3)
    assert look_along(ground.map, HERE.point, NedPoint(10.5, 18.5), 0.3).clear_m == pytest.approx(3.5, abs=0.3)


def test_look_along_never_leaves_the_grid():
    ground = Ground()
    ground.look_round(HERE, [], times=3)
    assert look_along(ground.map, HERE.point, NedPoint(10.5, -5.0), 0.3).clear_m <= 10.5
    assert look_along(ground.map, HERE.point, HERE.point, 0.3).clear_m == 0.0


def test_a_rover_close_to_a_wall_can_leave_it():
    ground = Ground()
    wall = [(10.9, 5.5 + 0.1 * i, 0.05) for i in range(101)]
    ground.look_round(Pose(9.0, 10.5, 0.0, 0.0), wall, times=20)
    beside = NedPoint(10.9 - 0.05 - RADIUS_M, 10.5)
    assert look_along(ground.map, beside, NedPoint(6.5, 10.5), 0.6).clear_m == pytest.approx(beside.north_m - 6.5)
    assert look_along(ground.map, beside, NedPoint(12.5, 10.5), 0.3).clear_m < 0.3


def test_clearance_is_the_distance_to_the_nearest_obstacle():
    ground = Ground()
    ground.look_round(HERE, [(13.5, 10.5, 0.25)], times=10)
    assert clearance_m(ground.map, HERE.point, 6.0) == pytest.approx(2.75, abs=0.3)
    assert clearance_m(ground.map, HERE.point, 1.5) == pytest.approx(1.5)


def test_very_large_maps_get_a_coarser_raster():
    assert new_map(empty_grid(3000, 1500), RADIUS_M, SETTINGS).evidence_m > SETTINGS.evidence_m
    assert new_map(empty_grid(100, 50), RADIUS_M, SETTINGS).evidence_m == SETTINGS.evidence_m


CELLS = st.sampled_from([0.0, 0.0, 0.0, -2.0, 0.7, 3.0])
BY = st.builds(Cell, st.integers(-9, 9), st.integers(-9, 9))


@given(arrays(np.float32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=CELLS, fill=st.just(0.0)), BY)
def test_a_shifted_raster_has_each_cell_where_it_belongs_and_nothing_else(cells: np.ndarray, by: Cell) -> None:
    moved = shifted(cells, (8, 7), by)
    for y, x in np.ndindex(8, 7):
        inside = 0 <= y - by.y < cells.shape[0] and 0 <= x - by.x < cells.shape[1]
        assert moved[y, x] == (cells[y - by.y, x - by.x] if inside else 0.0)


@given(arrays(np.float32, (8, 12), elements=CELLS, fill=st.just(0.0)), arrays(np.int32, (8, 12)), BY)
def test_a_moved_map_has_each_cell_where_it_belongs(cells: np.ndarray, stamps: np.ndarray, by: Cell) -> None:
    evidence = map_of(cells, stamps)
    assert move(evidence, 0.25 * by.y, 0.25 * by.x) == (0.25 * by.y, 0.25 * by.x)
    for now, before in ((evidence.log_odds, cells), (evidence.stamps, stamps)):
        assert (now == shifted(before, before.shape, by)).all()
    assert_noted(evidence)


@given(arrays(np.float32, (8, 12), elements=CELLS, fill=st.just(0.0)), arrays(np.int32, (8, 12)))
def test_fields_are_known_and_occupied_as_their_cells_are(cells: np.ndarray, stamps: np.ndarray) -> None:
    evidence = map_of(cells, stamps)
    known, occupied = known_fields(evidence), occupied_fields(evidence)
    assert known.shape == occupied.shape == (2, 3)
    for y, x in np.ndindex(2, 3):
        own = cells[4 * y : 4 * y + 4, 4 * x : 4 * x + 4]
        assert known[y, x] == (own != 0.0).any()
        assert occupied[y, x] == (own >= SETTINGS.occupied_at).any()


@given(
    arrays(np.float32, (8, 12), elements=CELLS, fill=st.just(0.0)),
    arrays(np.int32, (8, 12), elements=st.integers(0, 9)),
    st.floats(0.0, 3.0),
    st.floats(0.0, 2.0),
)
def test_what_is_forgotten_is_forgotten_wherever_it_lies(
    cells: np.ndarray, stamps: np.ndarray, east_m: float, north_m: float
) -> None:
    old, doubted, blank = (map_of(cells, stamps) for _ in range(3))
    obstacle = cells >= SETTINGS.occupied_at
    look_again(old, 5)
    assert (old.log_odds == np.where(obstacle & (stamps < 5), 0.0, cells)).all()
    forget(blank)
    assert not blank.log_odds.any()

    y, x = np.indices(cells.shape)
    near = (y >= 4 * north_m - 5) & (y <= 4 * north_m + 4) & (x >= 4 * east_m - 5) & (x <= 4 * east_m + 4)
    gone = obstacle & ((cells < SETTINGS.sure_at) | near)
    assert forget_weak_evidence(doubted, NedPoint(north_m, east_m), 1.0) == gone.any()
    assert (doubted.log_odds == np.where(gone, 0.0, cells)).all()
    assert (doubted.stamps == np.where(gone, np.maximum(stamps, 1), stamps)).all()


WEIGHTS = st.sampled_from([BASE_WEIGHT, BASE_WEIGHT, 0.5, 1.0])
PENALTIES = st.sampled_from([0.0, 0.0, 0.3, 1.5])


@given(
    st.data(),
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    st.sampled_from([1, 2, 4]),
    st.floats(0.0, 3.0),
    st.sampled_from(["circle", "outline"]),
)
def test_weights_are_those_of_all_evidence_wherever_it_lies(
    data: st.DataObject, shape: tuple[int, int], subdivisions: int, radius_m: float, keeps: str
) -> None:
    """Much or little of it, on maps of any size, also smaller than the rover; with ground that costs more."""
    settings = SETTINGS.model_copy(update={"keeps": keeps, "evidence_m": 1.0 / subdivisions, "soft_reach_m": 1.0})
    base = data.draw(arrays(np.float64, shape, elements=WEIGHTS, fill=st.just(BASE_WEIGHT)))
    cells = tuple(subdivisions * side for side in shape)
    seen = data.draw(arrays(np.float32, cells, elements=CELLS, fill=st.just(0.0)))
    penalty = data.draw(arrays(np.float32, shape, elements=PENALTIES, fill=st.just(0.0)))
    evidence = new_map(Grid(base), radius_m, settings)
    assert np.array_equal(evidence.grid.weights, weights_of_all_evidence(evidence)), "nothing is seen yet"
    restore(evidence, seen, penalty)
    assert np.array_equal(evidence.grid.weights, weights_of_all_evidence(evidence))
    move(evidence, *data.draw(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))))
    assert np.array_equal(evidence.grid.weights, weights_of_all_evidence(evidence))


def test_a_lone_obstacle_closes_the_fields_round_it_on_all_sides() -> None:
    """Far from the edges of the map, where alone evidence counts otherwise than near what was seen."""
    evidence = new_map(empty_grid(31, 31), 4.0, SETTINGS.model_copy(update={"evidence_m": 1.0, "soft_cost": 0.0}))
    cells = np.zeros((31, 31), np.float32)
    cells[15, 15] = 3.0
    restore(evidence, cells, np.zeros((31, 31), np.float32))
    y, x = np.indices(cells.shape)
    assert np.array_equal(evidence.grid.weights >= 1.0, np.hypot(y - 15, x - 15) < 4.0)


def test_what_costs_more_by_experience_costs_more_where_nothing_was_seen() -> None:
    evidence = new_map(empty_grid(31, 31), RADIUS_M, SETTINGS.model_copy(update={"soft_cost": 0.0}))
    penalise(evidence, Cell(15, 15), 0.2)
    penalise(evidence, Cell(20, 15), 2.0)
    move(evidence, 0.0, 0.0)
    expected = np.full((31, 31), BASE_WEIGHT)
    expected[15, 15], expected[15, 20] = BASE_WEIGHT + np.float32(0.2), 1.0
    assert evidence.grid.weights == pytest.approx(expected)


def test_what_costs_more_by_experience_moves_by_whole_fields() -> None:
    evidence = new_map(empty_grid(12, 12), RADIUS_M, SETTINGS.model_copy(update={"evidence_m": 0.25}))
    penalise(evidence, Cell(6, 6), 0.2)
    assert move(evidence, 2.75, -1.25) == (2.75, -1.25)
    assert np.argwhere(evidence.penalty).tolist() == [[9, 5]]


def test_a_map_that_is_taken_over_replaces_what_was_seen_and_keeps_within_the_limits() -> None:
    evidence = new_map(empty_grid(6, 6), RADIUS_M, SETTINGS.model_copy(update={"evidence_m": 1.0}))
    evidence.log_odds[0, 0] = evidence.log_odds[3, 3] = 2.0
    evidence.seen.add(0, 0, 4, 4)
    cells, penalty = np.zeros((6, 6), np.float32), np.zeros((6, 6), np.float32)
    cells[2, 2:5], penalty[1, :2] = (-50.0, 0.7, 50.0), (-1.0, 0.4)
    restore(evidence, cells, penalty)
    expected = np.zeros((6, 6), np.float32)
    expected[2, 2:5] = -SETTINGS.free_limit, 0.7, SETTINGS.limit
    assert np.array_equal(evidence.log_odds, expected)
    assert np.array_equal(evidence.penalty, np.maximum(penalty, 0.0))


def test_other_ground_of_the_missions_own_counts_at_once() -> None:
    evidence = new_map(empty_grid(20, 20), RADIUS_M, SETTINGS)
    closed = empty_grid(20, 20)
    closed.weights[10, 10] = 1.0
    rebase(evidence, closed)
    assert np.array_equal(evidence.grid.weights, new_map(closed, RADIUS_M, SETTINGS).grid.weights)
    assert evidence.grid.weights[10, 10] == 1.0


@pytest.mark.parametrize("drop", [forget, lambda evidence: look_again(evidence, 0)])
def test_what_experience_added_is_dropped_with_what_was_seen(drop: Callable[[EvidenceMap], None]) -> None:
    evidence = new_map(empty_grid(20, 20), RADIUS_M, SETTINGS)
    before = evidence.grid.weights.copy()
    penalise(evidence, Cell(10, 10), 0.3)
    drop(evidence)
    assert not evidence.penalty.any() and np.array_equal(evidence.grid.weights, before)


def test_what_experience_added_alone_is_a_reason_to_look_again_once() -> None:
    evidence = new_map(empty_grid(20, 20), RADIUS_M, SETTINGS)
    penalise(evidence, Cell(10, 10), 0.3)
    assert forget_weak_evidence(evidence, NedPoint(1.0, 1.0), 1.0)
    assert not evidence.penalty.any() and not forget_weak_evidence(evidence, NedPoint(1.0, 1.0), 1.0)


def map_of(cells: np.ndarray, stamps: np.ndarray) -> EvidenceMap:
    evidence = new_map(empty_grid(3, 2), RADIUS_M, SETTINGS.model_copy(update={"evidence_m": 0.25}))
    evidence.log_odds[:], evidence.stamps[:] = cells, stamps
    for y, x in np.argwhere((cells != 0.0) | (stamps != 0)):
        evidence.seen.add(int(x), int(y), int(x) + 1, int(y) + 1)
    return evidence


def test_what_nobody_looked_at_of_a_large_map_takes_no_memory() -> None:
    """A map of 100 million cells, on which little is seen, moved, forgotten and taken over by another run."""
    evidence = new_map(empty_grid(2000, 1990, 0.25), RADIUS_M, SETTINGS.model_copy(update={"evidence_m": 0.05}))
    assert evidence.log_odds.size > 99_000_000
    before_b = memory_b()
    for stamp in range(1, 61):  # all across it
        integrate(evidence, Pose(8.0 * stamp, 8.0 * stamp, 0.3, 0.0), scan(np.full(len(FULL_CIRCLE), 5.0)), stamp)
    known = known_fields(evidence).sum()
    assert 60 * 900 < known < 60 * 1700
    move(evidence, 3.0, -4.0)
    kept = shifted(evidence.log_odds, evidence.log_odds.shape, Cell(100, 100))
    look_again(evidence, 0)
    forget_weak_evidence(evidence, NedPoint(200.0, 200.0), 1.0)
    restore(evidence, kept, evidence.penalty)
    assert known_fields(evidence).sum() > 0.9 * known
    assert memory_b() - before_b < 250e6, "of 900 MB that it could hold"


def memory_b() -> float:
    """Of this process, as the system has it."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * float(mmap.PAGESIZE)


def test_a_post_that_comes_too_near_for_an_echo_is_not_freed_by_empty_rays() -> None:
    """A wired lidar gives no echo of what is nearer than its least range; beside and away from it the rays free."""
    evidence = new_map(empty_grid(20, 20, 0.5), RADIUS_M, SETTINGS)
    pose, nothing = Pose(5.0, 5.0, 0.0, 0.0), np.full(len(FULL_CIRCLE), np.inf)
    wired = replace(scan(nothing), sender=WIRED, source="lidar 1", origin_m=(0.3, 0.0))
    x, y = (int(one) for one in evidence.frame.xy(NedPoint(5.42, 5.0)))
    hit = nothing.copy()
    hit[0] = 0.42
    for stamp in range(1, 4):
        integrate(evidence, pose, replace(wired, range_m=hit), stamp)
    before = evidence.log_odds[y - 1 : y + 2, x - 1 : x + 1].max()
    assert before >= SETTINGS.occupied_at
    for stamp in range(4, 40):
        integrate(evidence, pose, replace(wired, range_m=nothing), stamp)
    assert evidence.log_odds[y - 1 : y + 2, x - 1 : x + 1].max() == before
    assert evidence.log_odds[y, x - 20] < 0.0 and evidence.log_odds[y, x + 20] < 0.0


@pytest.mark.parametrize(("field_m", "keeps"), [(0.5, "circle"), (0.15, "outline")])
def test_after_every_scan_the_weights_are_those_of_a_map_that_is_computed_anew(field_m: float, keeps: str) -> None:
    """Posts come and go, also beyond the edge, so that obstacles appear and disappear."""
    side, rng = round(12.0 / field_m), np.random.default_rng(3)
    settings = SETTINGS.model_copy(update={"keeps": keeps, "evidence_m": min(0.1, field_m / 3.0)})
    evidence = new_map(empty_grid(side, side, field_m), RADIUS_M, settings)
    obstacles = []
    for stamp in range(1, 25):
        pose = Pose(*rng.uniform(-1.0, 12.0, 2), rng.uniform(-3.0, 3.0), 0.0)
        posts = [(*rng.uniform(0.0, 12.0, 2), 0.3) for _ in range(stamp % 5)]
        seen_m = ranges(pose, posts, FULL_CIRCLE)
        seen_m[np.isinf(seen_m)] = (math.inf, math.nan, 3.0)[stamp % 3]
        one = replace(scan(seen_m), sender=stamp % 2, empty_m=5.0, origin_m=(0.4, 0.0))
        integrate(evidence, pose, one, stamp)
        again = new_map(evidence.base, RADIUS_M, settings)
        restore(again, evidence.log_odds, evidence.penalty)
        assert np.array_equal(evidence.grid.weights, again.grid.weights)
        assert np.array_equal(again.grid.weights, weights_of_all_evidence(again))
        assert_noted(evidence)
        obstacles.append(int((evidence.grid.weights >= 1.0).sum()))
    assert len(set(obstacles)) > 10


def weights_of_all_evidence(evidence: EvidenceMap) -> np.ndarray:
    """By the kernels alone, with no thought of what was seen."""
    settings, whole = evidence.settings, (0, 0, evidence.base.width, evidence.base.height)
    weights, radius = np.zeros(evidence.base.weights.shape), evidence.rover_radius_m / evidence.evidence_m
    fine = evidence.subdivisions * math.sqrt(2.0) <= radius
    weighs = weigh_roomy if settings.keeps == "outline" and fine else weigh
    weighs(evidence.log_odds, evidence.base.weights, evidence.penalty, weights, whole, settings.occupied_at, radius)
    soften(weights, whole, evidence.base.fields(settings.soft_reach_m), settings.soft_cost, MAX_SOFT_WEIGHT)
    return weights


def assert_noted(evidence: EvidenceMap) -> None:
    """That everything that is not zero counts as seen."""
    noted = np.zeros(evidence.log_odds.shape, np.bool_)
    for window in evidence.seen.windows():
        noted[window] = True
    assert noted[(evidence.log_odds != 0.0) | (evidence.stamps != 0)].all()


def test_what_was_seen_counts_as_seen_where_it_has_moved_to() -> None:
    evidence = new_map(empty_grid(40, 40), RADIUS_M, SETTINGS.model_copy(update={"evidence_m": 0.25}))
    evidence.log_odds[5, 5] = 3.0
    evidence.seen.add(5, 5, 6, 6)
    move(evidence, 20.0, 15.0)
    assert evidence.log_odds[85, 65] == 3.0
    assert_noted(evidence)


PLACES = st.tuples(st.integers(0, 159), st.integers(0, 159))


@given(
    st.tuples(st.integers(1, 80), st.integers(1, 80)),
    st.sampled_from(["circle", "outline"]),
    st.lists(PLACES, max_size=3),
    st.lists(PLACES, max_size=1),
    st.lists(PLACES, max_size=1),
)
@example((5, 60), "circle", [(4, 50), (7, 75)], [], [])
@example((13, 60), "outline", [(12, 50)], [], [])
def test_what_was_seen_anywhere_bears_on_the_fields_round_it_and_on_no_others(
    size: tuple[int, int], keeps: str, cells: list[Any], closed: list[Any], penalties: list[Any]
) -> None:
    """Single obstacles, one that the mission closes, and one by penalty, on large and tiny maps."""
    base = empty_grid(*size, 0.5)
    for x, y in closed:
        base.weights[y % size[1], x % size[0]] = 1.0
    evidence = new_map(base, 0.8, SETTINGS.model_copy(update={"keeps": keeps, "evidence_m": 0.25}))
    for x, y in ((east % (2 * size[0]), north % (2 * size[1])) for east, north in cells):
        evidence.log_odds[y, x] = 3.0
        evidence.seen.add(x, y, x + 1, y + 1)
    for x, y in penalties:
        evidence.penalty[y % size[1], x % size[0]] = 1.0
    rebase(evidence, evidence.base)
    assert np.array_equal(evidence.grid.weights, weights_of_all_evidence(evidence))


@given(
    st.lists(st.sampled_from([math.nan, math.inf, 0.3, 1.0, 3.0]), min_size=4, max_size=4),
    st.floats(0.1, 3.0),
    st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    st.floats(0.0, 0.6),
)
def test_all_that_a_scan_changes_counts_as_seen(
    range_m: list[float], radius_m: float, origin_m: tuple[float, float], depth_m: float
) -> None:
    settings = SETTINGS.model_copy(update={"evidence_m": 0.05, "hit_depth_m": depth_m})
    evidence = new_map(empty_grid(40, 40, 0.25), radius_m, settings)
    one = replace(scan(np.array(range_m), 0.5 * math.pi * np.arange(4)), empty_m=2.0, origin_m=origin_m)
    integrate(evidence, Pose(5.0, 5.0, 0.0, 0.0), one, 1)
    assert (evidence.log_odds != 0.0).any()
    assert_noted(evidence)
