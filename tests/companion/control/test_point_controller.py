"""From the path to one setpoint: what it must hold to, whatever its inner rules are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.control.braking import farthest_m, fastest_within_m, stopping_distance_m
from companion.control.controller import ControlCommand, Purpose
from companion.control.local_view import LocalView
from companion.control.point_controller import PointController, turn_to
from companion.control.reference_path import (
    STEP_M,
    ReferencePath,
)
from companion.control.setpoint_check import fault_of
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.map_queries import clearance_m, look_along
from companion.mission.bounds import Bounds
from companion.settings import Settings
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from tests.companion.control.test_reference_path import looked, northward
from tests.companion.mapping.test_evidence_map import HERE, Ground, scan

ALL_SETTINGS = Settings()
SETTINGS = ALL_SETTINGS.guidance
ROVER = RoverLimits(radius_m=0.35, cruise_speed_m_s=2.0, sight_m=8.0)


def view(
    ground: Ground, pose: Pose = HERE, speed_m_s: float = 0.0, rover: RoverLimits = ROVER, **guidance: float
) -> LocalView:
    settings = ALL_SETTINGS.model_copy(update={"guidance": SETTINGS.model_copy(update=guidance)})
    return LocalView(pose, speed_m_s, ground.map, rover, settings)


def told(
    ground: Ground, pose: Pose = HERE, speed_m_s: float = 0.0, path: ReferencePath | None = None
) -> ControlCommand:
    return PointController().follow(northward(ground) if path is None else path, view(ground, pose, speed_m_s))


def test_on_clear_ground_the_target_is_rolled_far_ahead_at_cruise_speed():
    answer = told(looked())
    assert answer.purpose is Purpose.DRIVE and answer.speed_m_s == 2.0
    assert isinstance(answer.setpoint, GuidedPosition)
    assert 6.0 < HERE.point.distance_m(answer.setpoint.point) <= SETTINGS.horizon_m + STEP_M


def test_the_target_never_lies_behind_an_obstacle():
    answer = told(looked([(15.0, 10.5, 0.3)]))
    assert isinstance(answer.setpoint, GuidedPosition)
    assert answer.setpoint.point.north_m <= 15.0 - 0.3 - ROVER.radius_m + 0.05


def test_ground_that_nobody_has_seen_is_looked_at_first():
    south = Pose(HERE.north_m, HERE.east_m, math.pi, 0.0)
    ground = Ground()
    answer = told(ground, south)
    assert answer.purpose is Purpose.LOOK and isinstance(answer.setpoint, GuidedHeading)
    assert abs(wrap_pi_rad(answer.setpoint.heading_rad)) < math.radians(45.0), "towards the route"


def test_a_rolling_rover_brakes_before_it_turns_on_the_spot():
    answer = told(Ground(), Pose(HERE.north_m, HERE.east_m, math.pi, 0.0), speed_m_s=1.5)
    assert answer.purpose is Purpose.BRAKE and answer.setpoint == GuidedVelocity(0.0, 0.0)


def test_it_brakes_for_what_it_would_touch():
    ground = looked([(12.0, 10.5, 0.3)])
    assert told(ground, speed_m_s=2.0).purpose is Purpose.BRAKE
    assert told(looked(), speed_m_s=2.0).purpose is Purpose.DRIVE


@pytest.mark.parametrize("turns_rad_s", [-0.4, 0.4])
def test_where_the_ground_held_it_it_brakes_for_what_it_would_touch_turning_on(turns_rad_s):
    """A wall beside its way: it is no danger to a rover that turns as told, nor on the other side."""
    east_m = 10.5 + math.copysign(0.75, turns_rad_s)
    ground = looked([(10.0 + 0.1 * i, east_m, 0.05) for i in range(60)])
    usual = replace(view(ground, speed_m_s=1.5), yaw_rate_rad_s=turns_rad_s)
    for moment, brakes in (
        (usual, False),
        (replace(usual, lately_held=True), True),
        (replace(usual, lately_held=True, yaw_rate_rad_s=0.0), False),
        (replace(usual, lately_held=True, yaw_rate_rad_s=-turns_rad_s), False),
    ):
        answer = PointController().follow(northward(ground), moment)
        assert (answer.purpose is Purpose.BRAKE) == brakes, moment


def test_a_wall_right_ahead_is_blocked():
    ground = Ground()
    wall = [(11.2, 8.0 + 0.1 * i, 0.05) for i in range(51)]
    ground.look_round(Pose(9.5, 10.5, 0.0, 0.0), wall, 10)
    answer = told(ground, Pose(10.6, 10.5, 0.0, 0.0), path=northward(ground, NedPoint(10.6, 10.5)))
    assert answer.purpose is Purpose.BLOCKED and answer.setpoint == GuidedVelocity(0.0, 0.0)


@pytest.mark.parametrize("post_m", [1.45, 1.55, 1.65, 1.75])
def test_creeping_between_beams_it_is_told_no_place_behind_what_stands_farther_on(post_m):
    """A single beam has freed the line, not the ground beside it, and has seen a post beside its end earlier."""
    pose, ground = Pose(10.56, 10.56, 0.0, 0.0), Ground()
    ground.take(pose, scan(np.array([4.0]), np.zeros(1)), times=10)
    post = NedPoint(pose.north_m + post_m, pose.east_m + 0.15)
    row, column = (int(metres * ground.map.subdivisions) for metres in (post.north_m, post.east_m))
    ground.map.log_odds[row, column] = ground.map.settings.limit
    path, controller = northward(ground, pose.point), PointController()
    answer = controller.follow(path, view(ground, pose, least_reach_m=0.6))
    while answer.purpose is Purpose.LOOK:  # having turned, it sees nothing new
        pose = replace(pose, heading_rad=answer.setpoint.heading_rad)
        answer = controller.follow(path, view(ground, pose, least_reach_m=0.6))
    assert answer.purpose is Purpose.DRIVE and isinstance(answer.setpoint, GuidedPosition)
    distance_m = pose.point.distance_m(answer.setpoint.point)
    assert 0.8 < distance_m < post_m
    assert look_along(ground.map, pose.point, answer.setpoint.point, ROVER.radius_m).clear_m >= distance_m - 0.01


@pytest.mark.parametrize("beside_m", [0.1, 0.3])
def test_creeping_it_comes_no_nearer_to_a_wall_beside_it(beside_m):
    """The line to the wall's end is free, but it leads nearer to the wall; the position may be wrong by as much."""
    pose, ground = Pose(10.56, 10.56, 0.0, 0.0), Ground()
    ground.take(pose, scan(np.array([4.0]), np.zeros(1)), times=10)
    cells = ground.map.subdivisions
    column = math.ceil((pose.east_m + ROVER.radius_m + beside_m) * cells)
    for along in range(int(10.0 * cells), int(14.0 * cells)):  # a wall that bends towards the rover's way
        bend = max(0, along - int(pose.north_m * cells)) // 4
        ground.map.log_odds[along, column - bend : column + 4] = ground.map.settings.limit
    path, controller, crept = northward(ground, pose.point), PointController(), 0
    for _ in range(4):
        answer = controller.follow(path, view(ground, pose, least_reach_m=0.6))
        if answer.purpose is Purpose.LOOK:  # having turned, it sees nothing new
            pose = replace(pose, heading_rad=answer.setpoint.heading_rad)
        if isinstance(answer.setpoint, GuidedPosition):
            crept += 1
            there = answer.setpoint.point
            # It stands 0.2 m or 0.3 m beside the wall; clearance_m (0.15 m), less half a cell, is kept.
            assert clearance_m(ground.map, there, 2.0) >= ROVER.radius_m + 0.1
    assert crept > 0


@pytest.mark.parametrize(
    ("narrow_sight", "wall", "crept_m"),
    [(False, True, (0.8, 2.0)), (True, True, (0.1, 0.41)), (True, False, (0.8, 2.0))],
)
def test_with_thin_beams_it_creeps_a_little_at_a_time_where_there_is_no_wide_room(narrow_sight, wall, crept_m):
    """Killed in between it touched a wall's end that the map had 0.3 m beside where it stood."""
    pose, ground = Pose(10.56, 10.56, 0.0, 0.0), Ground()
    ground.take(pose, scan(np.array([4.0]), np.zeros(1)), times=10)
    cells = ground.map.subdivisions
    column = math.ceil((pose.east_m + ROVER.radius_m + 0.2) * cells)
    if wall:
        ground.map.log_odds[int(11.0 * cells) :, column : column + 4] = ground.map.settings.limit
    path, controller = northward(ground, pose.point), PointController()
    at = view(ground, pose, rover=replace(ROVER, narrow_sight=narrow_sight), least_reach_m=0.6)
    answer = controller.follow(path, at)
    while answer.purpose is Purpose.LOOK:  # having turned, it sees nothing new
        at = replace(at, pose=replace(at.pose, heading_rad=answer.setpoint.heading_rad))
        answer = controller.follow(path, at)
    assert answer.purpose is Purpose.DRIVE and isinstance(answer.setpoint, GuidedPosition)
    distance_m = pose.point.distance_m(answer.setpoint.point)
    assert crept_m[0] <= distance_m <= crept_m[1]


def test_with_thin_beams_a_rover_that_stands_aside_of_its_path_creeps_no_farther_than_it_may_be_sent():
    """It had made way for a cart; the place 2.6 m away was refused, and it stood until that had gone."""
    pose, ground = Pose(10.56, 10.56, 0.0, 0.0), Ground()
    path, controller = northward(ground, pose.point.moved(math.pi / 2.0, 2.4)), PointController()
    moment = view(ground, pose, rover=replace(ROVER, narrow_sight=True))
    answer = controller.follow(path, moment)
    while answer.purpose is Purpose.LOOK:  # having turned, one beam sees the way to the path and nothing beside it
        pose = replace(pose, heading_rad=answer.setpoint.heading_rad)
        ground.take(pose, scan(np.array([4.0]), np.zeros(1)), times=10)
        moment = replace(moment, pose=pose)
        answer = controller.follow(path, moment)
    assert answer.purpose is Purpose.DRIVE
    assert 0.8 < pose.point.distance_m(answer.setpoint.point) <= farthest_m(0.0, SETTINGS, narrow=True)
    assert fault_of(answer.setpoint, moment, Bounds()) is None


@pytest.mark.parametrize(
    ("speed_m_s", "rate_deg_s", "purpose"),
    [(1.0, 58.0, Purpose.LOOK), (0.7, -90.0, Purpose.LOOK), (1.0, 57.0, Purpose.DRIVE), (0.6, 90.0, Purpose.DRIVE)],
)
def test_a_rover_that_rolls_and_turns_fast_is_given_no_position(speed_m_s: float, rate_deg_s: float, purpose: Purpose):
    """As at the wall's end on the real firmware: the position made it swing past, into the wall."""
    ground, aside = looked(), Pose(HERE.north_m, HERE.east_m, math.radians(20.0), 0.0)
    moment = replace(view(ground, aside, speed_m_s), yaw_rate_rad_s=math.radians(rate_deg_s))
    assert PointController().follow(northward(ground), moment).purpose is purpose


def test_once_it_swings_it_must_come_nearly_straight():
    ground, aside, controller = looked(), Pose(HERE.north_m, HERE.east_m, math.radians(20.0), 0.0), PointController()
    purposes = []
    for rate_deg_s in (57.0, 60.0, 57.0, 30.0, 27.0, 57.0):  # at 1 m/s; the limit is 57.3 and half of that
        moment = replace(view(ground, aside, 1.0), yaw_rate_rad_s=math.radians(rate_deg_s))
        purposes.append(controller.follow(northward(ground), moment).purpose)
    assert purposes == [Purpose.DRIVE, Purpose.LOOK, Purpose.LOOK, Purpose.LOOK, Purpose.DRIVE, Purpose.DRIVE]


@pytest.mark.parametrize(("narrow", "beside_m", "turns"), [(True, 1.0, True), (False, 1.0, False), (True, 3.5, False)])
def test_thin_beams_turn_on_the_spot_near_something(narrow: bool, beside_m: float, turns: bool):
    ground = looked([(HERE.north_m - 0.3, HERE.east_m + beside_m, 0.2)])
    aside, beams = Pose(HERE.north_m, HERE.east_m, math.radians(-15.0), 0.0), replace(ROVER, narrow_sight=narrow)
    answer = PointController().follow(northward(ground), view(ground, aside, rover=beams))
    assert isinstance(answer.setpoint, GuidedHeading if turns else GuidedPosition)


def test_near_an_obstacle_a_rover_that_swings_is_stopped():
    ground, aside = looked([(HERE.north_m, HERE.east_m + 1.0, 0.2)]), Pose(10.5, 10.5, math.radians(10.0), 0.0)
    moment = replace(view(ground, aside, 0.5), yaw_rate_rad_s=2.1)
    assert PointController().follow(northward(ground), moment).setpoint == GuidedVelocity(0.0, 0.0)


@pytest.mark.parametrize(("overrun_m", "anew"), [(0.29, False), (0.31, True), (-1.0, False)])
def test_a_rover_that_stands_beyond_its_position_is_stopped_before_the_next(overrun_m: float, anew: bool):
    """Long enough for ArduRover to forget the inner target, once; the next position is ahead again."""
    ground, controller = looked(), PointController()
    path = northward(ground)
    first = controller.follow(path, view(ground, speed_m_s=0.5, horizon_m=1.0)).setpoint
    assert isinstance(first, GuidedPosition) and first.point.north_m < HERE.north_m + 3.0
    there, told_s = Pose(first.point.north_m + overrun_m, first.point.east_m, 0.0, 5.0), []
    path = northward(ground, there.point)
    told = first
    for i in range(8):
        pose = replace(there, time_s=5.0 + 0.05 * i)
        told = controller.follow(path, replace(view(ground, pose), told=told)).setpoint
        if told == GuidedVelocity(0.0, 0.0):
            told_s.append(0.05 * i)
    assert told_s == (pytest.approx([0.0, 0.05, 0.1]) if anew else [])


@pytest.mark.parametrize("held_m_s", [0.0, 1.0, 1.5])
@pytest.mark.parametrize("wall_m", [1.2, 1.375, 1.5, 1.625, 2.0])
def test_whatever_holds_it_it_is_sent_nowhere_where_it_would_overshoot_into_a_wall(wall_m: float, held_m_s: float):
    """All ground is seen; also where it only creeps."""
    ground = looked()
    row = int((HERE.north_m + wall_m) * ground.map.subdivisions)
    ground.map.log_odds[:] = -1.0
    ground.map.log_odds[row : row + 4] = 3.0
    moment = replace(view(ground), held_m_s=held_m_s)
    answer = PointController().follow(northward(ground), moment)
    if isinstance(answer.setpoint, GuidedPosition):
        distance_m = HERE.point.distance_m(answer.setpoint.point)
        beyond_m = min(SETTINGS.overshoot_m, 0.1 * distance_m) + moment.further_m
        assert distance_m + beyond_m <= row / ground.map.subdivisions - HERE.north_m - ROVER.radius_m + 0.07
    else:
        assert wall_m < 2.0 or held_m_s > 0.0


def test_with_thin_beams_a_position_is_near_as_a_wall_that_they_missed_may_stand_on_the_way():
    ground, beams = looked(), replace(ROVER, narrow_sight=True)
    answer = PointController().follow(northward(ground), view(ground, rover=beams))
    assert isinstance(answer.setpoint, GuidedPosition)
    assert 1.0 < HERE.point.distance_m(answer.setpoint.point) <= SETTINGS.narrow_horizon_m + STEP_M
    assert answer.speed_m_s <= SETTINGS.narrow_speed_m_s


@pytest.mark.parametrize("bend_deg", [30.0, 60.0, 90.0])
@pytest.mark.parametrize("lead_m", [0.5, 0.75, 1.0, 1.25])
@pytest.mark.parametrize("from_deg", [-120.0, 0.0, 60.0, 180.0])
def test_with_thin_beams_it_sets_off_round_a_bend_once_it_has_looked(bend_deg: float, lead_m: float, from_deg: float):
    """It stands, all ground is seen, and what is near makes it turn before it drives."""
    ground, beams, controller = beside_wall(-1.6), replace(ROVER, narrow_sight=True), PointController()
    bend_rad, steps = math.radians(bend_deg), np.arange(0.0, 8.0, STEP_M)
    after_m = np.maximum(steps - lead_m, 0.0)
    north_m = HERE.north_m + np.minimum(steps, lead_m) + after_m * math.cos(bend_rad)
    path = ReferencePath(np.column_stack((north_m, HERE.east_m + after_m * math.sin(bend_rad))))
    heading_rad, told = math.radians(from_deg), []
    for tick in range(160):
        pose = replace(HERE, heading_rad=heading_rad, time_s=0.05 * tick)
        told.append(controller.follow(path, view(ground, pose, rover=beams)).setpoint)
        if isinstance(told[-1], GuidedHeading):
            heading_rad += min(max(wrap_pi_rad(told[-1].heading_rad - heading_rad), -0.06), 0.06)
    assert any(isinstance(setpoint, GuidedPosition) for setpoint in told), "it looks to and fro"


def beside_wall(wall_m: float) -> Ground:
    """All ground is seen; a wall runs north so far east of the rover."""
    ground = looked()
    column = int((HERE.east_m + wall_m) * ground.map.subdivisions)
    ground.map.log_odds[:] = -1.0
    ground.map.log_odds[:, column : column + 4] = 3.0
    return ground


@pytest.mark.parametrize(("held_m_s", "brakes"), [(0.0, False), (0.5, True)])
def test_one_that_is_held_does_not_turn_towards_a_wall_before_its_throttle_is_closed(held_m_s: float, brakes: bool):
    moment = replace(view(beside_wall(1.2)), speed_m_s=0.2, held_m_s=held_m_s)
    answer = turn_to(0.5 * math.pi, moment)
    assert answer.purpose is (Purpose.BRAKE if brakes else Purpose.LOOK)
    assert turn_to(-0.5 * math.pi, moment).purpose is Purpose.LOOK


@pytest.mark.parametrize(("held_m_s", "brakes"), [(0.0, False), (0.5, True)])
def test_one_that_is_held_brakes_before_a_wall_however_slow_it_is(held_m_s: float, brakes: bool):
    ground = looked()
    row = int((HERE.north_m + 1.2) * ground.map.subdivisions)
    ground.map.log_odds[:] = -1.0
    ground.map.log_odds[row : row + 4] = 3.0
    moment = replace(view(ground), speed_m_s=0.2, held_m_s=held_m_s)
    answer = PointController().follow(northward(ground), moment)
    assert (answer.purpose is Purpose.BRAKE) == brakes


def test_far_aside_it_turns_first():
    east = Pose(HERE.north_m, HERE.east_m, math.radians(120.0), 0.0)
    answer = told(looked(), east)
    assert answer.purpose is Purpose.LOOK
    assert abs(wrap_pi_rad(answer.setpoint.heading_rad)) < math.radians(10.0)


def test_it_does_not_turn_while_rolling_into_what_stands_in_between():
    east = Pose(HERE.north_m, HERE.east_m, math.radians(90.0), 0.0)
    assert told(looked(), east, speed_m_s=1.8).purpose is Purpose.LOOK
    post = looked([(HERE.north_m + 1.2, HERE.east_m + 1.2, 0.15)])
    assert told(post, east, speed_m_s=1.8).purpose is Purpose.BRAKE
    assert told(post, east).purpose is not Purpose.BRAKE, "standing, it may turn"


def test_obstacles_close_beside_slow_it_down_but_never_to_nothing():
    posts = [(north, 10.5 + side * 0.95, 0.1) for north in np.arange(9.0, 18.0, 0.3) for side in (-1.0, 1.0)]
    narrow = told(looked(posts, 20))
    assert narrow.purpose is Purpose.DRIVE
    assert SETTINGS.min_speed_m_s <= narrow.speed_m_s < told(looked()).speed_m_s


def test_a_short_sighted_sensor_limits_the_speed():
    near = RoverLimits(0.35, cruise_speed_m_s=5.0, sight_m=2.0)
    ground = looked()
    answer = PointController().follow(northward(ground), view(ground, rover=near))
    assert answer.speed_m_s < 5.0 and stopping_distance_m(answer.speed_m_s, SETTINGS) <= 2.0


@given(st.floats(0.0, 50.0))
def test_the_fastest_speed_stops_within_the_distance(distance_m):
    speed = fastest_within_m(distance_m, SETTINGS)
    assert stopping_distance_m(speed, SETTINGS) == pytest.approx(distance_m, abs=1e-6)
    assert fastest_within_m(-1.0, SETTINGS) == pytest.approx(0.0)


@pytest.mark.parametrize("seed", range(60))
def test_whatever_stands_round_it_the_way_to_the_target_is_clear_and_seen(seed):
    """Random posts, headings and speeds: no target beyond seen ground plus stopping distance, none through a post."""
    rng = np.random.default_rng(seed)
    posts = [
        (north, east, 0.25)
        for north, east in zip(rng.uniform(8.0, 19.0, 9), rng.uniform(5.0, 16.0, 9), strict=True)
        if math.hypot(north - HERE.north_m, east - HERE.east_m) > 1.2
    ]
    pose = Pose(HERE.north_m, HERE.east_m, rng.uniform(-math.pi, math.pi), 0.0)
    ground = Ground()
    ground.look_round(pose, posts, 10)
    speed_m_s = float(rng.uniform(0.0, 2.0))
    answer = told(ground, pose, speed_m_s)
    assert SETTINGS.min_speed_m_s <= answer.speed_m_s <= 2.0 or answer.speed_m_s == 0.0
    if answer.purpose in (Purpose.BRAKE, Purpose.BLOCKED):
        assert answer.setpoint == GuidedVelocity(0.0, 0.0)
    elif isinstance(answer.setpoint, GuidedPosition):
        target = answer.setpoint.point
        distance_m = pose.point.distance_m(target)
        line = look_along(ground.map, pose.point, target, ROVER.radius_m)
        assert line.clear_m >= distance_m - 0.1
        seen_m = line.seen_m + max(stopping_distance_m(speed_m_s, SETTINGS), SETTINGS.look_ahead_m)
        assert distance_m <= seen_m + 0.1
        # Against the truth, not the map: the straight way there touches no post.
        for north_m, east_m, radius_m in posts:
            along = np.linspace(0.0, distance_m, 200)
            bearing = pose.point.bearing_rad(target)
            gaps = np.hypot(
                pose.north_m + along * math.cos(bearing) - north_m, pose.east_m + along * math.sin(bearing) - east_m
            )
            assert gaps.min() > radius_m + ROVER.radius_m - 0.05
    else:
        assert answer.purpose is Purpose.LOOK


def test_where_its_path_ends_and_it_can_be_sent_nowhere_it_does_not_drive():
    """The end of a path that fields make may lie within centimetres of the rover, and something right before it."""
    ground, here = looked(), Pose(HERE.north_m, HERE.east_m, 1.2, 0.0)
    ground.map.log_odds[:] = 0.0
    path = ReferencePath(np.array([[HERE.north_m, HERE.east_m], [HERE.north_m + 0.05, HERE.east_m]]))
    assert told(ground, here, path=path).purpose is not Purpose.DRIVE


@pytest.mark.parametrize("seed", [47, 102, 203, 498, 502])
def test_a_rover_that_turns_as_told_has_soon_looked_enough(seed):
    """Round a bend behind posts: where a look shows nothing it drives, and does not turn to and fro."""
    rng = np.random.default_rng(seed)
    posts = [
        (HERE.north_m + north, HERE.east_m + east, 0.25)
        for north, east in rng.uniform(-3.0, 3.0, (8, 2))
        if math.hypot(north, east) > 0.75
    ]
    corners = np.cumsum([(HERE.north_m, HERE.east_m), (0.7, 0.5), (0.8, -0.6), (0.5, -0.9), (1.2, -1.5)], axis=0)
    along = np.linspace(0.0, 4.0, 20)
    path = ReferencePath(np.column_stack([np.interp(along, np.arange(5.0), corners[:, axis]) for axis in range(2)]))
    controller, pose, ground, headings = PointController(), HERE, Ground(), 0
    answer = None
    while answer is None or (isinstance(answer.setpoint, GuidedHeading) and headings < 10):
        ground.look_round(pose, posts, 10)
        answer = controller.follow(path, view(ground, pose))
        if isinstance(answer.setpoint, GuidedHeading):
            headings += 1
            pose = Pose(pose.north_m, pose.east_m, answer.setpoint.heading_rad, pose.time_s + 2.0)
    assert 0 < headings < 6


def test_ground_that_a_look_has_not_shown_is_not_looked_at_again_from_there():
    """Round the end of a wall: what lies in the wall is never seen. The rover turned to and fro for 20 s there."""
    ground, controller, pose, answers = looked(), PointController(), replace(HERE, heading_rad=1.4), []
    frame = ground.map.frame
    (east, face), (_, back) = frame.xy(NedPoint(11.0, 10.9)), frame.xy(NedPoint(12.0, 10.9))
    ground.map.log_odds[int(face) : int(back), : int(east)] = 0.0
    ground.map.log_odds[int(face), : int(east) - 1] = 3.0
    corners = np.array([(10.5, 10.5), (10.8, 11.2), (11.75, 11.0), (12.3, 10.4), (13.0, 9.7)])
    along = np.linspace(0.0, 4.0, 20)
    path = ReferencePath(np.column_stack([np.interp(along, np.arange(5.0), corners[:, axis]) for axis in range(2)]))
    for _ in range(6):
        answers.append(controller.follow(path, view(ground, pose)))
        match answers[-1].setpoint:
            case GuidedHeading(heading_rad):
                pose = replace(pose, heading_rad=heading_rad, time_s=pose.time_s + 2.0)
            case GuidedPosition(point):  # it begins by turning there
                pose = replace(pose, heading_rad=pose.point.bearing_rad(point), time_s=pose.time_s + 1.0)
    assert [one.purpose for one in answers] == [Purpose.LOOK, *[Purpose.DRIVE] * 5]
