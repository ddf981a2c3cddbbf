"""The controller of a rover that cannot turn on the spot: arcs that it can drive, over ground that it knows."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.control.arc_controller import ArcController, Rolling, _Ways
from companion.control.braking import blind_distance_m, braking_distance_m
from companion.control.collision_avoidance import avoided
from companion.control.controller import ControlCommand, Purpose
from companion.control.local_view import LocalView
from companion.control.manoeuvre import Try, find_manoeuvre
from companion.control.reference_path import ReferencePath
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.executive.goal_driver import GoalDriver
from companion.mapping.evidence_map import EvidenceMap, integrate, new_map
from companion.mapping.map_queries import Followed
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.search_budget import PathSearcher
from companion.navigation.step_runner import InlineRunner
from companion.perception.moving_obstacles import Moving
from companion.planning.problem import PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import Settings
from companion.vehicle.commands import GuidedVelocity

SETTINGS = Settings()
RADIUS_M = 2.5
ROVER = RoverLimits(0.35, 2.0, 8.0, turning_radius_m=RADIUS_M)
MIDDLE = 20.0
TICK_S = 0.05
Boxes = list[tuple[float, float, float, float]]


def ground(boxes: Boxes = (), unseen: Boxes = ()) -> EvidenceMap:  # type: ignore[assignment]
    """40 x 40 m seen free, but for obstacles and unseen ground: south, west, north, east in metres."""
    evidence = new_map(empty_grid(40, 40), ROVER.radius_m, SETTINGS.mapping)
    evidence.log_odds[:] = -1.0
    for value, places in ((0.0, unseen), (3.0, boxes)):
        for south, west, north, east in places:
            evidence.log_odds[round(south * 8) : round(north * 8), round(west * 8) : round(east * 8)] = value
    return evidence


def path(*corners: tuple[float, float]) -> ReferencePath:
    """North and east of the middle."""
    points = np.array(corners) + MIDDLE
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    along = np.linspace(0.0, lengths[-1], math.ceil(lengths[-1] / 0.25) + 1)
    return ReferencePath(np.column_stack([np.interp(along, lengths, points[:, axis]) for axis in (0, 1)]))


def pose(heading_deg: float = 0.0, north_m: float = 0.0, east_m: float = 0.0, time_s: float = 0.0) -> Pose:
    return Pose(MIDDLE + north_m, MIDDLE + east_m, math.radians(heading_deg), time_s)


def view(evidence: EvidenceMap, at: Pose, speed_m_s: float = 0.0) -> LocalView:
    return LocalView(at, speed_m_s, evidence, ROVER, SETTINGS)


class Car:
    """A rover that does at once what it is told, as far as it can: for loops without a simulator."""

    def __init__(self, evidence: EvidenceMap, way: ReferencePath, start: Pose) -> None:
        self.evidence, self.way, self.pose = evidence, way, start
        self.controller = ArcController()
        self.speed_m_s = 0.0
        self.curvature = 0.0
        self.poses = [start]
        self.commands: list[ControlCommand] = []

    def tick(self) -> ControlCommand:
        north, east = self.way.points.T
        ahead = slice(self.way.progress, self.way.progress + 17)
        nearest = int(np.argmin(np.hypot(north[ahead] - self.pose.north_m, east[ahead] - self.pose.east_m)))
        self.way = ReferencePath(self.way.points, self.way.progress + nearest)
        now = self.controller.follow(self.way, view(self.evidence, self.pose, abs(self.speed_m_s)))
        told = now.setpoint
        assert isinstance(told, GuidedVelocity), "it is never told a heading, and never a place"
        change = TICK_S * 1.0
        self.speed_m_s += min(max(told.forward_m_s - self.speed_m_s, -change), change)
        # As ArduRover: below 1 m/s the wheels turn for the turn rate as if at 1 m/s; they need 0.6 s to full lock.
        wanted = told.yaw_rate_rad_s / max(abs(self.speed_m_s), 1.0) * (-1.0 if self.speed_m_s < 0.0 else 1.0)
        wanted = min(max(wanted, -1.0 / RADIUS_M), 1.0 / RADIUS_M)
        most = TICK_S / 0.6 / RADIUS_M
        self.curvature += min(max(wanted - self.curvature, -most), most)
        way_m = self.speed_m_s * TICK_S
        heading = self.pose.heading_rad + way_m * self.curvature
        self.pose = Pose(
            self.pose.north_m + way_m * math.cos(heading),
            self.pose.east_m + way_m * math.sin(heading),
            math.remainder(heading, 2.0 * math.pi),
            self.pose.time_s + TICK_S,
        )
        self.poses.append(self.pose)
        self.commands.append(now)
        return now

    def drive(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.tick()
            if self.pose.point.distance_m(self.way.end) < 0.5:
                return

    @property
    def least_room_m(self) -> float:
        """Between the rover and any obstacle, over the whole drive."""
        y, x = np.nonzero(self.evidence.log_odds >= SETTINGS.mapping.occupied_at)
        if len(x) == 0:
            return math.inf
        return min(
            float(np.hypot((y + 0.5) / 8 - p.north_m, (x + 0.5) / 8 - p.east_m).min()) - ROVER.radius_m
            for p in self.poses[::4]
        )

    @property
    def reached(self) -> bool:
        return self.pose.point.distance_m(self.way.end) < 0.5


def driven(evidence: EvidenceMap, way: ReferencePath, start: Pose, seconds: float = 120.0) -> Car:
    car = Car(evidence, way, start)
    car.drive(seconds)
    return car


def test_straight_on_at_full_speed() -> None:
    car = driven(ground(), path((0, 0), (15, 0)), pose())
    assert car.reached
    assert car.controller.manoeuvre is None
    assert max(command.speed_m_s for command in car.commands) == ROVER.cruise_speed_m_s
    assert max(abs(command.setpoint.yaw_rate_rad_s) for command in car.commands) < 0.05  # type: ignore[union-attr]


@pytest.mark.parametrize("bearing_deg", [45, 90, 135, 180, -90, -160])
def test_a_place_anywhere_around_is_reached_on_arcs(bearing_deg: float) -> None:
    there = (12.0 * math.cos(math.radians(bearing_deg)), 12.0 * math.sin(math.radians(bearing_deg)))
    car = driven(ground(), path((0, 0), there), pose())
    assert car.reached
    assert Purpose.LOOK not in {command.purpose for command in car.commands}


def test_it_turns_in_three_moves_where_there_is_no_room_for_a_circle() -> None:
    walls = [(0.0, 16.5, 40.0, 17.0), (0.0, 23.0, 40.0, 23.5)]
    car = driven(ground(walls), path((0, 0), (-14, 0)), pose())
    assert car.reached
    assert car.least_room_m > 0.0
    assert min(command.setpoint.forward_m_s for command in car.commands) < 0.0  # type: ignore[union-attr]


def test_in_a_lane_too_narrow_to_turn_it_goes_back_tail_first() -> None:
    walls = [(0.0, 17.5, 40.0, 18.8), (0.0, 21.2, 40.0, 22.5), (24.0, 17.5, 25.0, 22.5)]
    car = driven(ground(walls), path((0, 0), (-8, 0)), pose())
    assert car.reached
    assert car.least_room_m > 0.0
    assert abs(car.pose.heading_rad) < math.radians(40.0)


def test_walled_in_it_stands_and_says_so() -> None:
    walls = [(18.8, 18.8, 21.2, 19.2), (18.8, 20.8, 21.2, 21.2), (18.8, 18.8, 19.2, 21.2), (20.8, 18.8, 21.2, 21.2)]
    car = driven(ground(walls), path((0, 0), (0, 8)), pose(), 10.0)
    assert car.least_room_m > 0.0
    assert car.commands[-1].purpose is Purpose.BLOCKED
    assert car.pose.point.distance_m(pose().point) < 0.6


def test_it_never_goes_backwards_over_ground_it_has_not_seen() -> None:
    """In a dead end, with too little room to turn round before the ground behind ends."""
    behind_unseen = [(0.0, 0.0, 19.4, 40.0)]
    car = Car(ground([(23.0, 17.0, 23.5, 23.0), (19.5, 17.0, 23.0, 18.5), (19.5, 21.5, 23.0, 23.0)], behind_unseen),
              path((2, 0), (-10, 0)), pose(north_m=2.0, time_s=1.0))  # fmt: skip
    car.drive(20.0)
    tails = [p.point.moved(p.heading_rad + math.pi, ROVER.radius_m).north_m for p in car.poses]
    assert 19.4 < min(tails) < 20.4
    assert car.least_room_m > 0.0


LANE = [(0.0, 17.5, 40.0, 19.1), (0.0, 20.9, 40.0, 22.5), (22.0, 17.5, 23.0, 22.5)]
"""With a dead end ahead."""


@pytest.mark.parametrize(("half_m", "backs"), [(0.25, False), (0.5, True)])
def test_a_manoeuvre_backwards_keeps_its_tail_on_seen_ground(half_m: float, backs: bool) -> None:
    """A strip of seen ground, wide enough for its middle or for its tail. It may turn round and look first."""
    unseen = [(17.0, 19.0, 18.0, MIDDLE - half_m), (17.0, MIDDLE + half_m, 18.0, 21.0)]
    found = find_manoeuvre(path((0, 0), (-8, 0)), view(ground(LANE, unseen), pose()), Try(5.0, 0.1))
    assert found is not None
    tail_first = [segment.points[:, 0] for segment in found.segments if segment.backwards]
    assert any(((north_m > 17.0) & (north_m < 18.0)).any() for north_m in tail_first) == backs


def test_a_manoeuvre_that_cannot_be_driven_on_is_given_up() -> None:
    """Ground that was seen when it was found is not any more: it does not stand before it for ever."""
    car = Car(ground(LANE), path((0, 0), (-8, 0)), pose(time_s=1.0))
    car.drive(2.0)
    first = car.controller.manoeuvre
    assert first is not None and car.controller.backwards
    car.evidence.log_odds[: round(18.0 * 8)] = 0.0
    car.drive(8.0)
    assert car.controller.manoeuvre is None or car.controller.manoeuvre.end != first.end


def test_what_is_seen_of_a_way_backwards_ends_where_the_tail_would_leave_it() -> None:
    ways = _Ways(view(ground(unseen=[(0.0, 0.0, MIDDLE - 2.0, 40.0)]), pose()), Rolling(0.0, 0.0), 0.0)
    followed = ways.follow(path((0, 0), (-6, 0)).points, 0, 0.1, backwards=True)
    assert followed.seen_m == pytest.approx(2.0 - ROVER.radius_m - 0.05, abs=0.13)


def test_backwards_it_does_not_creep_over_unseen_ground() -> None:
    """With 0.2 m of seen ground before it; forwards a look would have shown what is there."""
    ways, ahead = _Ways(view(ground(), pose()), Rolling(0.0, 0.0), 0.0), Followed(5.0, 0.2, 0.0)
    assert ways.drive(ahead, backwards=False, left_m=5.0).purpose is Purpose.DRIVE
    assert ways.drive(ahead, backwards=True, left_m=5.0).purpose is Purpose.BLOCKED


def test_left_alone_backwards_its_tail_ends_on_seen_ground() -> None:
    seen_m = 2.0
    ways = _Ways(view(ground(unseen=[(0.0, 0.0, MIDDLE - seen_m, 40.0)]), pose()), Rolling(0.0, 0.0), 0.0)
    told = ways.drive(Followed(math.inf, math.inf, 0.0), backwards=True, left_m=8.0).setpoint
    assert isinstance(told, GuidedVelocity) and told.forward_m_s < -0.2
    assert blind_distance_m(-told.forward_m_s, SETTINGS.guidance) + ROVER.radius_m <= seen_m


def test_it_can_stop_within_what_it_has_seen() -> None:
    unseen_m = 25.0
    car = Car(ground(unseen=[(unseen_m, 0.0, 40.0, 40.0)]), path((0, 0), (12, 0)), pose(time_s=1.0))
    creep_m = braking_distance_m(SETTINGS.guidance.min_speed_m_s, SETTINGS.guidance)
    for _ in range(120):
        car.tick()
        stop_m = car.pose.north_m + braking_distance_m(abs(car.speed_m_s), SETTINGS.guidance)
        assert stop_m <= unseen_m + creep_m + 0.15
    assert car.pose.north_m > unseen_m - 1.5


def test_what_comes_up_on_its_arc_stops_it_on_that_arc() -> None:
    evidence = ground()
    car = Car(evidence, path((0, 0), (3, 2.5), (3.5, 9)), pose(20.0, time_s=1.0))
    for _ in range(35):
        car.tick()
    assert car.speed_m_s > 0.8
    arc_rad = car.pose.heading_rad + 0.5 * car.curvature * 0.9
    there = car.pose.point.moved(arc_rad, 0.95)
    y, x = round(there.north_m * 8), round(there.east_m * 8)
    evidence.log_odds[y - 1 : y + 2, x - 1 : x + 2] = 3.0
    now = car.tick()
    assert now.purpose is Purpose.BRAKE
    assert isinstance(now.setpoint, GuidedVelocity) and now.setpoint.forward_m_s == 0.0
    assert now.setpoint.yaw_rate_rad_s == pytest.approx(car.curvature * max(car.speed_m_s, 1.0), abs=0.15)


def test_with_thin_beams_arcs_are_slow() -> None:
    beams, guidance = replace(ROVER, narrow_sight=True), SETTINGS.guidance
    moment = replace(view(ground(), pose(time_s=1.0), 0.5), rover=beams)
    told = ArcController().follow(path((0, 0), (15, 0)), moment)
    assert 0.0 < told.speed_m_s <= 0.5 * guidance.narrow_speed_m_s
    assert ArcController().follow(path((0, 0), (15, 0)), replace(moment, rover=ROVER)).speed_m_s > 1.0


def test_with_thin_beams_it_creeps_where_a_wall_has_a_gap() -> None:
    """Two pieces of a wall were seen, and what lies between was not: it may be wall."""
    moment = replace(view(ground(), pose(0.0, 0.0, -0.03, 1.0), 0.3), rover=replace(ROVER, narrow_sight=True))
    pieces: Boxes = [(20.4, 20.75, 20.6, 21.0), (21.6, 20.75, 21.8, 21.0)]
    gap: Boxes = [(20.6, 20.375, 21.6, 20.5)]
    way = path((0, -0.03), (8, -0.03))
    for seen, unseen, most_m_s in ((pieces, gap, 0.2), (pieces, [], 0.5), ([], gap, 0.5)):
        told = ArcController().follow(way, replace(moment, evidence=ground(seen, unseen))).speed_m_s
        assert told == pytest.approx(most_m_s), (seen, unseen)


def test_slow_arcs_are_told_as_if_at_one_metre_a_second() -> None:
    """Below MOT_SPD_SCA_BASE ArduRover drives only the share of a turn rate that the speed is of it."""
    turned = np.linspace(0.0, 4.0, 100)
    car = Car(ground(), path(*zip(4.0 * np.sin(turned), 4.0 - 4.0 * np.cos(turned), strict=True)), pose(time_s=1.0))
    told = []
    for _ in range(80):
        now = car.tick()
        assert isinstance(now.setpoint, GuidedVelocity)
        told.append((car.speed_m_s, now.setpoint.yaw_rate_rad_s))
    slow = [rate for speed, rate in told if 0.3 < speed < 0.8]
    fast = [rate / speed for speed, rate in told if speed > 1.5]
    assert slow == pytest.approx([1.0 / 4.0] * len(slow), abs=0.06)
    assert fast == pytest.approx([1.0 / 4.0] * len(fast), abs=0.06)
    assert len(slow) > 5 and len(fast) > 5


# In the driver -------------------------------------------------------------------------------------------------------


def test_the_planner_is_told_heading_and_radius() -> None:
    asked: list[PlanningProblem] = []
    planner = make_planner("hybrid", SETTINGS.planner)

    class Spy:
        name, capabilities = planner.name, planner.capabilities

        def plan(self, problem, budget, rng):  # type: ignore[no-untyped-def]
            asked.append(problem)
            return planner.plan(problem, budget, rng)

    searcher = PathSearcher(Spy(), np.random.default_rng(1))
    driver = GoalDriver(ArcController(), searcher, InlineRunner())
    start = view(ground(), pose(30.0))
    there = NedPoint(MIDDLE, MIDDLE + 10.0)
    driver.head_for(ResolvedTarget("t", there, start.evidence.base.cell_at(there), 0.0, OnBlocked.SKIP, None), start)
    driver.decide(start)
    command = driver.guide(start)
    assert asked[0].kinematics.heading_rad == pytest.approx(math.radians(60.0)), "from east towards north"
    assert asked[0].kinematics.turning_radius_fields == pytest.approx(RADIUS_M * SETTINGS.steering.planned_radius)
    assert isinstance(command.setpoint, GuidedVelocity)


def test_it_makes_way_on_arcs_and_never_turns_on_the_spot() -> None:
    path_on = path((0, 0), (16, 0))
    now = ControlCommand(Purpose.DRIVE, GuidedVelocity(2.0, 0.0), 2.0)
    crossing = Moving("m", 0.0, NedPoint(MIDDLE + 4.0, MIDDLE - 3.0), 0.0, 1.2, 0.5)
    option = avoided(now, path_on, view(ground(), pose(), 1.5), (crossing,))
    assert isinstance(option.command.setpoint, GuidedVelocity) and option.yields and option.aside_rad is None
    # Something comes straight on while it stands: out of its way on an arc, for straight back would not be enough.
    coming = Moving("m", 0.0, NedPoint(MIDDLE + 4.0, MIDDLE), -0.9, 0.0, 0.5)
    way = avoided(now, None, view(ground(), pose()), (coming,)).command
    assert isinstance(way.setpoint, GuidedVelocity)
    assert way.setpoint.forward_m_s != 0.0 and way.setpoint.yaw_rate_rad_s != 0.0
    # With walls on both sides there is only straight back.
    walls = [(0.0, 18.0, 40.0, 19.0), (0.0, 21.0, 40.0, 22.0)]
    way = avoided(now, None, view(ground(walls), pose()), (coming,)).command
    assert isinstance(way.setpoint, GuidedVelocity)
    assert way.setpoint.forward_m_s < 0.0 and way.setpoint.yaw_rate_rad_s == 0.0
    # But not where only its middle would be on seen ground.
    strip = [(0.0, 19.0, 19.5, MIDDLE - 0.25), (0.0, MIDDLE + 0.25, 19.5, 21.0)]
    way = avoided(now, None, view(ground(walls, strip), pose()), (coming,)).command
    assert isinstance(way.setpoint, GuidedVelocity) and way.setpoint.forward_m_s >= 0.0
    # Rolling backwards it is not asked to go forwards at once.
    way = avoided(now, None, view(ground(), pose(), 0.7), (coming,), backwards=True).command
    assert isinstance(way.setpoint, GuidedVelocity) and way.setpoint.forward_m_s <= 0.0


def test_a_scan_from_far_off_the_map_changes_nothing_of_it() -> None:
    evidence = ground()
    weights = evidence.grid.weights.copy()
    bearings = np.radians(np.arange(0.0, 360.0, 5.0))
    scan = RangeScan(0.0, bearings, np.full(72, 3.0), 0.1, 8.0, np.radians(5.0), "test")
    integrate(evidence, Pose(-60.0, 20.0, 0.0, 0.0), scan, 1)
    assert np.array_equal(evidence.grid.weights, weights)
