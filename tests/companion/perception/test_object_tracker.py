"""What the sensors see moving, what they do not, and how long its trail stays in the map."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.scan import RangeScan
from companion.mapping.evidence_map import EvidenceMap, integrate, new_map
from companion.perception.moving_obstacles import Moving
from companion.perception.object_tracker import ObjectTracker, Sighting, Track
from companion.settings import Settings
from sitl.sensors.range_sensors import SUITES
from sitl.world.movers import Mover, timed_track
from sitl.world.world import World
from tests.support.shared_data import SHARED, needs_shared

SETTINGS = Settings()
PERIOD_S = 0.1


class Watcher:
    """A rover that stands (or drives north) and looks about, with the simulator's own rays and 2 cm of noise."""

    def __init__(
        self,
        world: World,
        suite: str,
        seed: int,
        speed_m_s: float = 0.0,
        sways_rad: float = 0.0,
        drifts_m: float = 0.0,
        drift_rad_s: float = 0.8,
    ) -> None:
        """``sways_rad``: so far it turns to either side, in 6 s. ``drifts_m``: so far off its place seems to be, each
        way in pi / ``drift_rad_s`` seconds.
        """
        lidar = SUITES[suite].lidar
        assert lidar is not None
        self.world, self.lidar, self.speed_m_s = world, lidar, speed_m_s
        self.sways_rad, self.drifts_m, self.drift_rad_s = sways_rad, drifts_m, drift_rad_s
        self.evidence: EvidenceMap = new_map(empty_grid(40, 40), 0.35, SETTINGS.mapping)
        self.tracker = ObjectTracker(self.evidence)
        self.chance = np.random.default_rng(seed)
        self.scans = 0

    def look(self) -> tuple[Moving, ...]:
        time_s = self.scans * PERIOD_S
        self.scans += 1
        true = Pose(10.0 + self.speed_m_s * time_s, 20.0, self.sways_rad * math.sin(time_s), time_s)
        off_m = self.drifts_m * math.sin(self.drift_rad_s * time_s)
        pose = replace(true, north_m=true.north_m + off_m, east_m=true.east_m - off_m)
        lidar = self.lidar
        looks_rad = true.heading_rad + lidar.bearings_rad()
        true_m = self.world.rays_m(true.north_m, true.east_m, looks_rad, lidar.max_m, time_s)
        range_m = np.where(true_m >= lidar.max_m, np.inf, true_m + self.chance.normal(0.0, 0.02, true_m.shape))
        bearings = np.radians(np.arange(72) * lidar.increment_deg + lidar.offset_deg)
        scan = RangeScan(time_s, bearings, range_m, 0.1, lidar.max_m, np.radians(lidar.increment_deg), "test")
        self.tracker.take(pose, self.sways_rad * math.cos(time_s), scan)
        integrate(self.evidence, pose, scan, self.scans)
        self.tracker.remember(pose, lidar.max_m)
        return self.tracker.moving(time_s, SETTINGS.traffic)


def ground(*movers: Mover) -> World:
    obstacles = np.zeros((40, 40), np.bool_)
    obstacles[17:19, 10:18] = True
    obstacles[5:14, 24] = True
    return World(obstacles, movers=movers)


@pytest.mark.parametrize("suite", ["lidar-90", "lidar-360"])
@pytest.mark.parametrize("speed_m_s", [0.6, 1.2])
def test_what_crosses_is_seen_moving(suite: str, speed_m_s: float) -> None:
    errors = []
    for seed in range(6):
        track = timed_track(
            [(13.0, 28.0 if suite == "lidar-360" else 23.9), (13.0, 10.0)], speed_m_s, 1.0, repeats=False
        )
        watcher = Watcher(ground(Mover("m", 0.5, track)), suite, seed)
        watcher.world.obstacles[5:14, 24] = False
        for _ in range(10 + round(6.5 / speed_m_s / PERIOD_S)):
            found = watcher.look()
            time_s = (watcher.scans - 1) * PERIOD_S
            errors += [
                (abs(one.east_m_s + speed_m_s), abs(one.north_m_s), one.at(time_s).distance_m(NedPoint(*there)))
                for one in found
                for there in [watcher.world.mover_at(0, time_s)[:2]]
            ]
    assert len(errors) > 60
    along, across, place = np.percentile(np.array(errors), 80, axis=0)
    assert along < 0.4 and across < 0.4 and place < 0.7


@pytest.mark.parametrize("suite", ["lidar-90", "lidar-360"])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.8])
def test_what_stands_is_never_taken_for_something_that_moves(suite: str, speed_m_s: float) -> None:
    for seed in range(5):
        watcher = Watcher(ground(), suite, seed, speed_m_s)
        assert sum(len(watcher.look()) for _ in range(80)) == 0


@pytest.mark.parametrize("apart_m", [0.3, 0.4, 1.0, 1.5])
def test_posts_in_a_row_do_not_move_with_the_rover(apart_m: float) -> None:
    posts = [(6.0 + apart_m * i, 22.0, 0.05) for i in range(40)]
    assert movers_among(posts, 0) == 0


def test_trunks_seldom_seem_to_move() -> None:
    """60 of all sizes beside the way, over 8 seeds: the trunk behind must not be taken for the one before it."""
    found = []
    for seed in range(8):
        chance = np.random.default_rng(seed)
        norths, sides = chance.uniform(8.0, 30.0, 60), chance.choice((-1.0, 1.0), 60)
        easts, sizes = 20.0 + sides * chance.uniform(1.0, 4.0, 60), chance.uniform(0.05, 0.25, 60)
        found.append(movers_among(list(zip(norths, easts, sizes, strict=True)), seed))
    assert np.mean(found) <= 3.0, found


def movers_among(posts: list[tuple[float, float, float]], seed: int) -> int:
    """In how many of 60 scans something seems to move, passing posts (north, east, radius) that stand."""
    movers = tuple(Mover("post", radius_m, np.array([[0.0, north_m, east_m]])) for north_m, east_m, radius_m in posts)
    watcher = Watcher(World(np.zeros((40, 40), np.bool_), movers=movers), "lidar-90", seed, 1.9)
    return sum(bool(watcher.look()) for _ in range(60))


@pytest.mark.parametrize(("suite", "least_m"), [("lidar-90", 3.0), ("lidar-360", 3.3)])
def test_a_walker_on_ground_that_was_never_seen_is_noticed_in_time(suite: str, least_m: float) -> None:
    """It comes into the narrow view of a rover at 1.9 m/s and walks across its way: braking takes 2.7 m."""
    met_m = 10.0 + 1.9 * 5.0
    track = timed_track([(met_m, 20.0 + 0.9 * 5.0), (met_m, 10.0)], 0.9, 0.0, repeats=False)
    for seed in range(6):
        watcher = Watcher(World(np.zeros((40, 40), np.bool_), movers=(Mover("m", 0.4, track),)), suite, seed, 1.9)
        ahead_m = 0.0
        while not ahead_m:
            if any(abs(one.east_m_s + 0.9) < 0.4 and abs(one.north_m_s) < 0.4 for one in watcher.look()):
                ahead_m = met_m - (10.0 + 1.9 * (watcher.scans - 1) * PERIOD_S)
        assert ahead_m > least_m


def test_a_walker_at_the_edge_of_the_view_is_noticed_in_time_and_goes_where_it_goes() -> None:
    """It would pass close behind: the edge of the view cuts it off from the first, at 4 m."""
    sees_s, there_m = 3.0, 10.0 + 2.0 * 3.0 + 3.55
    track = timed_track([(there_m, 23.0 + 0.9 * sees_s), (there_m, 10.0)], 0.9, 0.0, repeats=False)
    for seed in range(6):
        watcher = Watcher(World(np.zeros((40, 40), np.bool_), movers=(Mover("m", 0.4, track),)), "lidar-90", seed, 2.0)
        found = [watcher.look() for _ in range(round(sees_s / PERIOD_S) + 8)][-1]
        assert len(found) == 1
        assert abs(found[0].east_m_s + 0.9) < 0.3 and abs(found[0].north_m_s) < 0.3
        there = watcher.world.mover_at(0, found[0].time_s)[:2]
        assert found[0].point.distance_m(NedPoint(*there)) < 0.35


@pytest.mark.parametrize("speed_m_s", [1.0, 1.9])
def test_corners_and_ends_of_walls_at_the_edge_of_the_view_do_not_move(speed_m_s: float) -> None:
    """The view of a rover that drives past sweeps over them."""
    for seed in range(6):
        chance = np.random.default_rng(seed)
        obstacles = np.zeros((40, 40), np.bool_)
        for north in range(11, 30, 3):
            east = int(chance.choice((17, 18, 21, 22)))
            obstacles[north : north + int(chance.integers(1, 3)), east : east + int(chance.integers(1, 3))] = True
        obstacles[:, 19:21] = False
        watcher = Watcher(World(obstacles), "lidar-90", seed, speed_m_s)
        assert sum(bool(watcher.look()) for _ in range(80)) <= 3


def test_trunks_and_corners_seldom_seem_to_move_past_a_rover_that_turns() -> None:
    """Ten worlds each, 80 scans, turning by 23 degrees a second at most, with a place that wanders by 15 cm."""
    found = []
    for seed in range(20):
        chance = np.random.default_rng(seed)
        obstacles, trunks = np.zeros((40, 40), np.bool_), ()
        norths, sides = chance.uniform(9.0, 30.0, 30), chance.choice((-1.0, 1.0), 30)
        if seed % 2:
            places = zip(norths, 20.0 + sides * chance.uniform(1.4, 4.0, 30), chance.uniform(0.1, 0.6, 30), strict=True)
            trunks = tuple(Mover("trunk", size_m, np.array([[0.0, n, e]])) for n, e, size_m in places)
        else:
            obstacles[norths.astype(int), (20.0 + sides * chance.uniform(1.5, 4.0, 30)).astype(int)] = True
        watcher = Watcher(World(obstacles, movers=trunks), "lidar-90", seed, 1.2, 0.4, 0.15)
        found.append(sum(bool(watcher.look()) for _ in range(80)))
    assert sum(found) <= 1, found


def test_walls_seldom_seem_to_move_when_the_place_wanders() -> None:
    """Twelve corridors with rooms, 100 scans each, with a place that wanders by 30 cm: pieces of the walls then
    lie on ground that seems to have been free. In at most 2 % of the scans.
    """
    found = []
    for seed in range(12):
        chance = np.random.default_rng(seed)
        obstacles = np.zeros((200, 200), np.bool_)
        obstacles[:, (70, 130)] = True
        for north in range(50, 190, 25):
            obstacles[north, 70:130] = True
            obstacles[north, 90:110] = False
            for east in (70, 130):
                door = north + int(chance.integers(2, 18))
                obstacles[door : door + 6, east] = False
        watcher = Watcher(World(obstacles, 0.2), "lidar-360", seed, 1.5, 0.4, 0.3, 0.4)
        found.append(sum(bool(watcher.look()) for _ in range(100)))
    assert sum(found) <= 24, found


@needs_shared
def test_a_real_rover_among_legs_of_tables_seldom_sees_something_move() -> None:
    """A Hokuyo on the MinesRover through rooms, by its wheels alone: in at most an eighth of 640 scans."""
    lines = (SHARED / "data/lidar/breezyslam/exp2.dat").read_text(encoding="utf-8").splitlines()
    evidence = new_map(empty_grid(60, 60), 0.35, SETTINGS.mapping)
    tracker, bearings = ObjectTracker(evidence), -np.radians(np.linspace(-120.0, 120.0, 682)[::3])
    pose, before, moves = Pose(30.0, 30.0, 0.0, 0.0), None, 0
    for scans, line in enumerate(filter(str.strip, lines), 1):
        row = np.array(line.split(), float)
        yaw_rate_rad_s = 0.0
        if before is not None:
            elapsed_s = (row[0] - before[0]) / 1e6
            left_m, right_m = 2.0 * math.pi * 0.077 * (row[2:4] - before[2:4]) / 2000.0
            yaw_rate_rad_s = (left_m - right_m) / 0.33 / elapsed_s
            there = pose.point.moved(pose.heading_rad, (left_m + right_m) / 2.0)
            heading_rad = pose.heading_rad + yaw_rate_rad_s * elapsed_s
            pose = Pose(there.north_m, there.east_m, heading_rad, row[0] / 1e6)
        before, range_m = row, row[24:706:3] / 1000.0
        valid, range_m = range_m > 0.05, np.where(range_m < 4.0, range_m, np.inf)
        scan = RangeScan(pose.time_s, bearings[valid], range_m[valid], 0.05, 4.0, math.radians(240.0 / 227), "real")
        tracker.take(pose, yaw_rate_rad_s, scan)
        integrate(evidence, pose, scan, scans)
        tracker.remember(pose, scan.max_range_m)
        moves += bool(tracker.moving(pose.time_s, SETTINGS.traffic))
    assert 600 < scans < 660
    assert moves <= 80


def test_what_moves_among_posts_is_seen() -> None:
    """It crosses, in 6 s, between posts that stand 2.2 m apart, before a rover that looked about before."""
    posts = [(11.6 + 2.2 * i, 12.0 + 2.2 * k, 0.08) for i in range(4) for k in range(9)]
    standing = tuple(Mover("post", size_m, np.array([[0.0, n, e]])) for n, e, size_m in posts)
    for seed in range(6):
        track = timed_track([(12.7, 24.5), (12.7, 14.0)], 0.9, 1.0, repeats=False)
        world = World(np.zeros((40, 40), np.bool_), movers=(Mover("m", 0.35, track), *standing))
        watcher = Watcher(world, "lidar-360", seed)
        seen = [any(one.east_m_s < -0.5 for one in watcher.look()) for _ in range(110)]
        assert sum(seen[30:]) >= 33


def test_walkers_one_behind_the_other_are_seen() -> None:
    """Five, 0.3 m between them, pass on ground that was seen free."""
    found = []
    for seed in range(4):
        tracks = [timed_track([(14.0, 25.0 + 0.9 * i), (14.0, 12.0)], 0.9, 1.0, repeats=False) for i in range(5)]
        movers = tuple(Mover(f"m{i}", 0.3, track) for i, track in enumerate(tracks))
        watcher = Watcher(World(np.zeros((40, 40), np.bool_), movers=movers), "lidar-360", seed)
        found.append(sum(any(one.east_m_s < -0.5 for one in watcher.look()) for _ in range(110)))
    assert sum(found) >= 70, found


def test_what_moves_is_seen_while_the_rover_turns_quickly() -> None:
    """It turns by up to 80 degrees a second."""
    for seed in range(6):
        track = timed_track([(13.0, 27.0), (13.0, 10.0)], 0.9, 1.0, repeats=False)
        world = World(np.zeros((40, 40), np.bool_), movers=(Mover("m", 0.5, track),))
        watcher = Watcher(world, "lidar-360", seed, 0.0, 1.4)
        seen = [any(one.east_m_s < -0.5 for one in watcher.look()) for _ in range(110)]
        assert sum(seen[20:110]) >= 75


def found_in(ranges_m: list[np.ndarray], free: np.ndarray, yaw_rate_rad_s: float = 0.0, seed: int = 0) -> list[Moving]:
    """What has moved in such scans of a full circle, from straight ahead on, 0.1 s apart, after others that saw
    bearings ``free`` up to 8 m and nothing of the rest. With a ``seed`` their readings come in no order.
    """
    beams = len(free)
    evidence = new_map(empty_grid(40, 40), 0.35, SETTINGS.mapping)
    tracker, order = ObjectTracker(evidence), np.arange(beams)
    if seed:
        order = np.random.default_rng(seed).permutation(beams)
    bearing_rad, width_rad = np.radians(order * 360.0 / beams), math.radians(360.0 / beams)
    before = [np.where(free, np.inf, np.nan)] * 5
    for scans, range_m in enumerate([*before, *ranges_m], 1):
        pose = Pose(20.0, 20.0, 0.0, scans * PERIOD_S)
        scan = RangeScan(pose.time_s, bearing_rad, range_m[order], 0.1, 8.0, width_rad, "test")
        tracker.take(pose, yaw_rate_rad_s, scan)
        if scans <= len(before):
            integrate(evidence, pose, scan, scans)
            tracker.remember(pose, 8.0)
    return list(tracker.moving(pose.time_s, SETTINGS.traffic))


def wall_behind(away_m: float, right_m: float, left_m: float) -> np.ndarray:
    """Ranges of 72 beams to a wall straight behind, so far to either side."""
    beside_rad = np.radians(np.arange(72) * 5.0 - 180.0)
    to_the_left_m = away_m * np.tan(beside_rad)
    met = (np.abs(beside_rad) < 1.5) & (-right_m <= to_the_left_m) & (to_the_left_m <= left_m)
    return np.where(met, away_m / np.cos(beside_rad), np.inf)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("away_m", "right_m", "left_m"), [(2.5, 1.8, 3.4), (6.8, 2.9, 4.5)])
def test_a_piece_of_a_wall_on_free_ground_does_not_move(
    away_m: float, right_m: float, left_m: float, seed: int
) -> None:
    """Its right part seems to come nearer, on ground that was free. Alone it moves; as a piece of a wall of which most
    stands on other ground it does not.
    """
    free = (np.arange(72) >= 15) & (np.arange(72) <= 36)
    assert found_in([wall_behind(away_m - 0.05 * k, right_m, -0.1) for k in range(10)], free, seed=seed)
    assert not found_in([wall_behind(away_m - 0.05 * k, right_m, left_m) for k in range(10)], free, seed=seed)


@pytest.mark.parametrize(("nearest_m", "moves"), [(1.4, True), (4.5, False)])
def test_a_single_reading_of_a_wide_beam_does_not_move(nearest_m: float, moves: bool) -> None:
    """A wall at a flat angle, its readings 0.9 m apart: of beams that are at most 0.28, or at least 0.33 m wide."""
    scans = []
    for k in range(10):
        range_m = np.full(72, np.inf)
        range_m[9], range_m[10:13] = np.nan, nearest_m + 0.9 * np.arange(3) - 0.08 * k
        scans.append(range_m)
    assert bool(found_in(scans, np.ones(72, np.bool_))) is moves


def test_a_thin_walker_far_away_whom_one_beam_meets_is_seen() -> None:
    """Nothing is near on either side: it is no wall at a flat angle."""
    scans = []
    for k in range(10):
        range_m = np.full(72, np.inf)
        range_m[9] = 6.0 - 0.1 * k
        scans.append(range_m)
    found = found_in(scans, np.ones(72, np.bool_))
    assert len(found) == 1 and found[0].speed_m_s == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("beams", "yaw_rate_deg_s", "moves"), [(180, 0.0, True), (180, 44.0, True), (180, 46.0, False), (171, 0.0, False)]
)
def test_beams_of_two_degrees_see_what_moves_on_ground_never_seen(
    beams: int, yaw_rate_deg_s: float, moves: bool
) -> None:
    scans = []
    for k in range(10):
        range_m = np.full(beams, np.inf)
        range_m[20 : 20 + 7] = 3.0 - 0.1 * k
        scans.append(range_m)
    assert bool(found_in(scans, np.zeros(beams, np.bool_), math.radians(yaw_rate_deg_s))) is moves


@pytest.mark.parametrize(
    ("suite", "radius_m", "speed_m_s", "least"), [("lidar-360", 0.25, 1.0, 45), ("lidar-90", 0.4, 0.45, 25)]
)
def test_what_moves_along_a_wall_is_seen(suite: str, radius_m: float, speed_m_s: float, least: int) -> None:
    """With 0.3 m of room between the two."""
    north_m = 15.0 - 0.3 - radius_m
    for seed in range(3):
        obstacles = np.zeros((40, 40), np.bool_)
        obstacles[15] = True
        track = timed_track([(north_m, 23.8), (north_m, 16.2)], speed_m_s, 2.0, repeats=False)
        watcher = Watcher(World(obstacles, movers=(Mover("m", radius_m, track),)), suite, seed)
        seen = [any(abs(one.east_m_s + speed_m_s) < 0.3 for one in watcher.look()) for _ in range(130)]
        assert sum(seen) >= least


def test_four_scans_are_enough_also_where_they_do_not_come_exactly_in_time() -> None:
    seen = tuple(Sighting(time_s, 5.0 + time_s, 3.0, 0.4, 0.0, 0.5, True) for time_s in (0.0, 0.1, 0.2, 0.2999))
    assert Track(1, seen[:3]).estimate is None
    estimate = Track(1, seen).estimate
    assert estimate is not None and estimate[1] and estimate[0].north_m_s == pytest.approx(1.0)


def test_the_trail_of_something_that_moves_is_soon_free_again() -> None:
    track = timed_track([(13.0, 12.0), (13.0, 40.0)], 1.0, 1.0, repeats=False)
    watcher = Watcher(World(np.zeros((40, 40), np.bool_), movers=(Mover("m", 0.5, track),)), "lidar-360", 3)
    blocked_s: dict[tuple[int, int], float] = {}
    for _ in range(170):
        watcher.look()
        time_s = (watcher.scans - 1) * PERIOD_S
        there = watcher.world.mover_at(0, time_s)[:2]
        for y, x in np.argwhere(watcher.evidence.grid.weights[8:18, 14:27] >= 1.0):
            # Fields that the disc, the rover's radius added, left more than a field ago.
            if there[1] - (x + 14.5) > 0.5 + 0.35 + 1.0:
                blocked_s[y, x] = blocked_s.get((y, x), 0.0) + PERIOD_S
    assert max(blocked_s.values(), default=0.0) < 2.0
    assert not (watcher.evidence.grid.weights[8:18, 14:24] >= 1.0).any()
