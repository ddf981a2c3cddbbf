"""Making way: before what crosses, for what comes straight on, and not for what is no danger."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.control.collision_avoidance import (
    CollisionAvoidance,
    Option,
    avoided,
    first_near,
    least_room_m,
    middles_of,
)
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.local_view import LocalView
from companion.control.motion_prediction import Points, braked_m, moved_on_arc
from companion.control.reference_path import ReferencePath
from companion.control.setpoint_check import fault_of
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.mapping.evidence_map import EvidenceMap, integrate, new_map
from companion.mission.bounds import Bounds
from companion.perception.moving_obstacles import Moving
from companion.settings import Settings
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from tests.support.quick import examples

SETTINGS = Settings()
ROVER = RoverLimits(0.35, 2.0, 8.0)
HERE = Pose(20.0, 20.0, 0.0, 100.0)
PATH = ReferencePath(np.column_stack((np.linspace(20.0, 36.0, 65), np.full(65, 20.0))))
DRIVE = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(28.0, 20.0)), 2.0)


def open_ground(walls_m: float = math.inf) -> EvidenceMap:
    """Ground seen free all round the rover; with walls so far beside it."""
    evidence = new_map(empty_grid(40, 40), ROVER.radius_m, SETTINGS.mapping)
    bearings = np.radians(np.arange(0.0, 360.0, 1.0))
    side_m = walls_m / np.maximum(np.abs(np.sin(bearings)), 1e-9)
    ranges = np.where(side_m < 8.0, side_m, np.inf)
    for stamp in (1, 2, 3):
        integrate(evidence, HERE, RangeScan(0.0, bearings, ranges, 0.1, 8.0, np.radians(1.0), "test"), stamp)
    return evidence


def goes_on(option: Option) -> bool:
    return not option.yields and option.command == DRIVE


def crossing(east_m: float, east_m_s: float, north_m: float = 24.0) -> Moving:
    return Moving("m", 100.0, NedPoint(north_m, 20.0 + east_m), 0.0, east_m_s, 0.5)


def view(speed_m_s: float, evidence: EvidenceMap | None = None, pose: Pose = HERE) -> LocalView:
    return LocalView(pose, speed_m_s, open_ground() if evidence is None else evidence, ROVER, SETTINGS)


def made(
    moving: Moving, speed_m_s: float = 1.5, ground: EvidenceMap | None = None, now: ControlCommand = DRIVE
) -> Option:
    return avoided(now, PATH, view(speed_m_s, ground), (moving,))


def test_what_is_foreseen_counts_and_not_the_line() -> None:
    """A rover that is told to back off meets what comes from behind, and not what crosses its line ahead."""
    back = ControlCommand(Purpose.DRIVE, GuidedVelocity(-0.5, 0.0), 0.5)
    behind = Moving("m", 100.0, NedPoint(17.6, 20.0), 0.5, 0.0, 0.5)

    def backs(times_s: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Points:
        return np.column_stack((HERE.north_m - 0.5 * times_s, np.full(len(times_s), HERE.east_m)))

    for moving, yields in ((behind, True), (crossing(-3.0, 1.0, 22.5), False)):
        option = avoided(back, PATH, view(0.0), (moving,), foresees=backs)
        assert (option.command != back) == yields
    assert avoided(back, PATH, view(0.0), (behind,)).command == back, "along the line it would get away"


def test_it_stops_before_the_way_of_what_crosses() -> None:
    # Both would be 4 m ahead at the same time.
    assert made(crossing(-3.0, 1.2)).command.setpoint == GuidedVelocity(0.0, 0.0)


@pytest.mark.parametrize(
    ("speed_m_s", "told_m_s", "north_m", "east_m"),
    [(0.6, 0.2, 21.7, -1.75), (0.6, 0.5, 21.85, -2.25), (0.9, 0.2, 22.15, -2.0), (1.2, 0.5, 22.75, -3.0)],
)
def test_a_rover_that_can_stop_only_with_half_the_margin_does_not_go_on_a_little_first(
    speed_m_s: float, told_m_s: float, north_m: float, east_m: float
) -> None:
    """Told to drive on, and to brake, in turn, it would brake late."""
    now = ControlCommand(Purpose.DRIVE, GuidedVelocity(told_m_s, 0.0), told_m_s)

    def slows(times_s: Points) -> Points:
        fine_s = np.arange(0.0, times_s[-1] + 0.01, 0.01)
        speeds = np.maximum(speed_m_s - 0.8 * np.maximum(fine_s - 0.25, 0.0), told_m_s)
        along_m = np.interp(times_s, fine_s, np.concatenate(([0.0], np.cumsum(0.01 * speeds[:-1]))))
        return np.column_stack((HERE.north_m + along_m, np.full(len(times_s), HERE.east_m)))

    option = avoided(now, PATH, view(speed_m_s), (crossing(east_m, 0.8, north_m),), foresees=slows)
    assert option.command == stop_for(Purpose.BRAKE)


def test_once_it_stops_for_something_it_does_not_go_on_beside_it() -> None:
    """Its path turns off in front of a walker: a little farther it may always go. When it stops, the walker passes."""
    on, brake = ControlCommand(Purpose.DRIVE, GuidedVelocity(1.0, 0.0), 1.0), stop_for(Purpose.BRAKE)

    def turns_off(times_s: Points) -> Points:
        along_m = 1.0 * times_s
        return np.column_stack((HERE.north_m + np.minimum(along_m, 3.0), HERE.east_m + np.maximum(along_m - 3.0, 0.0)))

    beside = Moving("m", 100.0, NedPoint(18.9, 21.5), 0.9, 0.0, 0.4)
    assert avoided(on, PATH, view(0.8), (beside,), foresees=turns_off).command == on
    assert avoided(on, PATH, view(0.8), (beside,), foresees=turns_off, stops=True).command == brake
    led, crosses = CollisionAvoidance(), crossing(-1.5, 0.9, 22.5)
    told = [
        led.avoid(on, PATH, view(0.8), moving, backwards=False, foresees=turns_off).command
        for moving in ((beside,), (crosses,), (beside,), (), (beside,))
    ]
    assert told == [on, brake, brake, on, on], "until nothing is in the way"


def test_it_goes_on_while_it_can_still_stop_later() -> None:
    far = Moving("m", 100.0, NedPoint(32.0, 12.0), 0.0, 1.2, 0.5)
    assert goes_on(made(far))


def test_it_goes_on_when_the_other_has_passed() -> None:
    assert goes_on(made(crossing(2.0, 1.2), 0.0))


@pytest.mark.parametrize("moving", [crossing(0.5, 0.0), crossing(-30.0, 1.0), crossing(-3.0, -1.2)])
def test_what_stands_is_far_or_goes_away_is_no_reason(moving: Moving) -> None:
    assert goes_on(made(moving))


def test_it_moves_aside_for_what_comes_straight_at_it() -> None:
    towards = Moving("m", 100.0, NedPoint(26.0, 20.0), -1.0, 0.0, 0.5)
    standing = ControlCommand(Purpose.BLOCKED, GuidedVelocity(0.0, 0.0), 0.0)
    option = made(towards, 0.0, now=standing)
    assert option.yields and option.command.purpose is Purpose.LOOK and option.aside_rad is not None
    assert abs(math.sin(option.aside_rad)) > 0.6
    # And it keeps to the side it has chosen.
    again = avoided(standing, PATH, view(0.0), (towards,), aside_rad=option.aside_rad)
    assert again.aside_rad == option.aside_rad


@pytest.mark.parametrize("speed_m_s", [0.0, 0.3])
def test_with_thin_beams_it_is_told_no_place_aside_that_the_last_look_refuses(speed_m_s: float) -> None:
    """Turned aside already, it is told to drive there."""
    towards = Moving("m", 100.0, NedPoint(26.0, 20.0), -1.5, 0.0, 0.5)
    east = replace(HERE, heading_rad=0.5 * math.pi)
    moment = view(speed_m_s, pose=east)
    moment = replace(moment, rover=replace(moment.rover, narrow_sight=True))
    option = avoided(stop_for(Purpose.STAND), None, moment, (towards,), aside_rad=0.5 * math.pi)
    assert isinstance(option.command.setpoint, GuidedPosition)
    assert fault_of(option.command.setpoint, moment, Bounds()) is None


def test_a_long_rover_does_not_turn_aside_into_a_post() -> None:
    body, comes = Footprint.rectangle(2.0, 0.5), Moving("m", 100.0, NedPoint(25.0, 20.0), -1.2, 0.0, 0.5)
    told = []
    for posts in ((), ((20.6, 19.5), (19.4, 20.5), (20.6, 20.5), (19.4, 19.5))):
        ground = open_ground()
        for north_m, east_m in posts:
            y, x = (math.floor(v / ground.evidence_m) for v in (north_m, east_m))
            ground.log_odds[y, x] = 3.0
        told.append(avoided(DRIVE, PATH, replace(view(0.0, ground), body=body), (comes,)).command.setpoint)
    assert isinstance(told[0], GuidedHeading) and not isinstance(told[1], GuidedHeading | GuidedPosition)


def test_backing_out_is_foreseen_as_going_back() -> None:
    """Who crosses behind the rover is not backed into."""
    back = ControlCommand(Purpose.LOOK, GuidedVelocity(-0.4, 0.0), 0.4)
    for north_m, goes in ((19.1, False), (23.0, True)):
        behind = Moving("m", 100.0, NedPoint(north_m, 18.8), 0.0, 0.6, 0.3)
        for rolls_back in (False, True):
            at = replace(view(0.3 if rolls_back else 0.0), rolls_back=rolls_back)
            assert (avoided(back, PATH, at, (behind,)).command == back) is goes


def test_it_backs_off_between_walls() -> None:
    towards = Moving("m", 100.0, NedPoint(22.0, 20.0), -0.35, 0.0, 0.5)
    standing = ControlCommand(Purpose.BLOCKED, GuidedVelocity(0.0, 0.0), 0.0)
    setpoint = made(towards, 0.0, open_ground(1.0), standing).command.setpoint
    assert isinstance(setpoint, GuidedVelocity) and setpoint.forward_m_s < 0.0


@given(
    st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.0, 3.0)
)  # fmt: skip
@settings(max_examples=examples(60), deadline=None)
def test_room_is_what_is_left_at_the_nearest_moment(
    north_m: float, east_m: float, north_m_s: float, east_m_s: float, speed_m_s: float
) -> None:
    times_s = np.arange(0.0, 5.0, 0.2)
    places = np.column_stack((speed_m_s * times_s, np.zeros_like(times_s)))
    discs = np.array([[north_m, east_m, north_m_s, east_m_s, 0.8]])
    gaps = np.hypot(north_m + north_m_s * times_s - places[:, 0], east_m + east_m_s * times_s) - 0.8
    none = np.zeros_like(times_s)
    assert least_room_m(places, discs, times_s, none) == pytest.approx(float(gaps.min()))
    first_s, least_m, closing_m_s = first_near(places, discs, times_s, 0.1)
    near = times_s[gaps < 0.1]
    assert (first_s, least_m) == pytest.approx((near[0] if near.size else math.inf, gaps.min()))
    if near.size:
        assert closing_m_s == pytest.approx(math.hypot(north_m_s - speed_m_s, east_m_s))


@pytest.mark.parametrize("seed", range(5))
def test_where_every_way_would_touch_it_brakes_and_does_not_waver(seed: int) -> None:
    """A walker is recognised 3 m ahead at 1.9 m/s; its velocity is not known exactly. Stopping is never given up."""
    chance = np.random.default_rng(seed)
    for _ in range(10):
        pace_m_s, drift_m_s = chance.uniform(0.8, 1.1), chance.normal(0.0, 0.1)
        walker = Moving("m", 100.0, NedPoint(22.9, 17.9), drift_m_s, pace_m_s, 0.65)
        assert made(walker, 1.87).command.setpoint == GuidedVelocity(0.0, 0.0)


def drives_on(times_s: Points) -> Points:
    return np.column_stack((HERE.north_m + 1.9 * times_s, np.full(len(times_s), HERE.east_m)))


def test_while_it_brakes_it_does_not_go_on_because_it_might_just_pass() -> None:
    """A walker's pace is known to 0.2 m/s at best: a rover that brakes, and goes on in turn, does neither in time."""
    on, walker = ControlCommand(Purpose.DRIVE, GuidedVelocity(2.0, 0.0), 2.0), crossing(-2.3, 0.9, 22.5)
    walker = replace(walker, radius_m=0.65)
    assert avoided(on, PATH, view(1.9), (walker,), foresees=drives_on).command == on
    braking = avoided(on, PATH, view(1.9), (walker,), foresees=drives_on, stops=True)
    assert braking.command == stop_for(Purpose.BRAKE)
    standing = avoided(on, PATH, view(0.0), (crossing(-1.0, 0.1, 20.2),), foresees=drives_on, stops=True)
    assert standing.command != stop_for(Purpose.BRAKE), "one that stands gets out of the way"


def test_where_stopping_straight_on_would_touch_it_turns_off_while_it_stops() -> None:
    """Of the ways to do so that the ground allows it takes the one with most room; it is not needed farther away."""
    on = ControlCommand(Purpose.DRIVE, GuidedVelocity(2.0, 0.0), 2.0)
    rates_rad_s = (-1.5, -0.7, 0.7, 1.5)
    ways = [ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, rate), 0.0) for rate in rates_rad_s]

    def turned_stops(times_s: Points) -> list[tuple[ControlCommand, Points]]:
        rolled_m = braked_m(1.9, times_s, SETTINGS.guidance)
        return [
            (way, moved_on_arc(HERE, 0.0, rate / 2.0, rolled_m)) for way, rate in zip(ways, rates_rad_s, strict=True)
        ]

    def told(moving: Moving) -> ControlCommand:
        return avoided(on, PATH, view(1.9), (moving,), foresees=drives_on, turned_stops=turned_stops).command

    near, mirrored = crossing(2.1, -0.9, 22.9), crossing(-2.1, 0.9, 22.9)
    assert (told(near), told(mirrored)) == (ways[3], ways[0])
    led, tells = CollisionAvoidance(), []
    for moving in (near, mirrored, crossing(-3.0, 1.2), mirrored):
        tells.append(
            led.avoid(
                on, PATH, view(1.9), (moving,), backwards=False, foresees=drives_on, turned_stops=turned_stops
            ).command
        )
    stop = stop_for(Purpose.BRAKE)
    assert tells[0] == ways[3] and tells[2] == stop and tells[1] in ways[2:] and tells[3] in ways[2:], "the same side"
    assert avoided(on, PATH, view(1.9), (near,), foresees=drives_on).command not in ways
    assert told(crossing(-3.0, 1.2)) == stop_for(Purpose.BRAKE)


def test_what_it_turned_off_for_is_expected_to_go_on_when_it_is_out_of_view() -> None:
    """For five seconds since it was known last; what left the view of a rover that went straight on is not."""
    on, turns = DRIVE, ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, 1.5), 0.0)
    walker, cart = crossing(2.1, -0.9, 22.9), replace(crossing(-3.0, 1.2), name="cart")

    def turned_stops(times_s: Points) -> list[tuple[ControlCommand, Points]]:
        return [(turns, moved_on_arc(HERE, 0.0, 0.75, braked_m(1.9, times_s, SETTINGS.guidance)))]

    def led_past(moving: Moving, now_s: float) -> CollisionAvoidance:
        led = CollisionAvoidance()
        led.with_what_it_turned_off_for((moving,), now_s)
        option = led.avoid(
            on, PATH, view(1.9), (moving,), backwards=False, foresees=drives_on, turned_stops=turned_stops
        )
        assert (option.command == turns) is (moving is walker)
        led.with_what_it_turned_off_for((moving,), now_s + 0.1)
        return led

    off = led_past(walker, 100.0)
    assert off.with_what_it_turned_off_for((), 101.0) == (walker,)
    later = replace(walker, time_s=103.0)
    assert off.with_what_it_turned_off_for((later,), 103.05) == (later,), "seen again, it counts once"
    assert off.with_what_it_turned_off_for((), 108.0) == (later,)
    assert off.with_what_it_turned_off_for((), 108.1) == ()
    assert off.with_what_it_turned_off_for((cart,), 109.0) == (cart,)
    assert off.with_what_it_turned_off_for((), 109.1) == (), "it does not turn any more"
    straight = led_past(cart, 100.0)
    assert straight.with_what_it_turned_off_for((), 101.0) == ()


@pytest.mark.parametrize("speed_m_s", [1.0, 1.5, 1.9])
@pytest.mark.parametrize("gap_m", [0.05, 0.2, 0.6, 1.0])
def test_told_to_go_slower_it_stops_before_what_comes_straight_at_it(speed_m_s: float, gap_m: float) -> None:
    """Too near for anything: it must not go on to a position beyond the other only because it is told to slow down."""
    towards = Moving("m", 100.0, NedPoint(20.0 + gap_m + 0.85, 20.0), -1.0, 0.0, 0.5)
    slowly = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(24.0, 20.0)), 0.5)
    setpoint = made(towards, speed_m_s, open_ground(0.45), slowly).command.setpoint
    assert isinstance(setpoint, GuidedVelocity) and setpoint.forward_m_s <= 0.0


def test_it_keeps_to_the_side_it_moves_to_where_every_way_would_touch() -> None:
    near, standing = (
        Moving("m", 100.0, NedPoint(21.4, 20.0), -0.8, 0.0, 0.7),
        ControlCommand(Purpose.BLOCKED, GuidedVelocity(0.0, 0.0), 0.0),
    )
    for aside_rad in (0.5 * math.pi, -0.5 * math.pi):
        option = avoided(standing, PATH, view(0.0), (near,), aside_rad=aside_rad)
        assert option.aside_rad == aside_rad


def test_the_place_at_which_it_may_be_left_alone_is_not_in_the_way_of_something() -> None:
    """It may go on and will be past in time, but the position that it would be told lies in the other's way."""
    coming = Moving("m", 100.0, NedPoint(28.0, 31.0), 0.0, -0.9, 0.7)
    for speed_m_s in (1.0, 1.9):
        told = made(coming, speed_m_s).command
        assert told.purpose is Purpose.DRIVE and isinstance(told.setpoint, GuidedPosition)
        assert told.setpoint.point.north_m < 28.0 - 0.7 - ROVER.radius_m
    beyond = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(30.5, 20.0)), 2.0)
    assert made(coming, 1.9, now=beyond).command == beyond


def test_to_look_about_it_does_not_stay_where_something_comes() -> None:
    """It may be left alone with that message: a forklift that is 7 s away counts."""
    coming = Moving("m", 100.0, NedPoint(20.0, 26.5), 0.0, -0.8, 0.7)
    look = ControlCommand(Purpose.LOOK, GuidedHeading(1.0), 0.5)
    assert made(coming, 0.0, now=look).yields
    passing = Moving("m", 100.0, NedPoint(23.0, 26.5), 0.0, -0.8, 0.7)
    assert not made(passing, 0.0, now=look).yields


def test_a_plan_of_meeting_by_chance_is_never_driven_into() -> None:
    """Played through: whatever crosses the straight way at an even speed, a rover that obeys is never touched."""
    chance = np.random.default_rng(7)
    ground = open_ground()
    for _ in range(20):
        meets_s, pace_m_s = chance.uniform(2.0, 7.0), chance.uniform(0.5, 1.5) * chance.choice((-1.0, 1.0))
        moving = Moving("m", 100.0, NedPoint(20.0 + 1.8 * meets_s, 20.0 - pace_m_s * meets_s), 0.0, pace_m_s, 0.5)
        north_m, speed_m_s, gaps = 20.0, 1.5, []
        for tick in range(200):
            pose = Pose(north_m, 20.0, 0.0, 100.0 + 0.05 * tick)
            path = ReferencePath(PATH.points, min(round((north_m - 20.0) / 0.25), 64))
            option = avoided(DRIVE, path, view(speed_m_s, ground, pose), (moving,))
            wanted_m_s = 0.0 if option.yields else 2.0
            speed_m_s += min(max(wanted_m_s - speed_m_s, -0.8 * 0.05), 0.8 * 0.05)
            north_m = min(north_m + speed_m_s * 0.05, 36.0)
            gaps.append(moving.at(pose.time_s).distance_m(NedPoint(north_m, 20.0)) - 0.85)
        assert min(gaps) > 0.0


def test_it_looks_where_it_really_drives_and_not_where_the_route_is() -> None:
    """The path goes round the other; the place told to the rover lies behind it: straight there they would meet."""
    round_it = np.vstack(
        (
            np.column_stack((np.full(16, 20.0), np.arange(20.0, 24.0, 0.25))),
            np.column_stack((np.arange(20.0, 36.0, 0.25), np.full(64, 24.0))),
        )
    )
    other = Moving("m", 100.0, NedPoint(23.5, 22.2), -0.4, 0.0, 0.5)

    def yields(told: NedPoint) -> bool:
        now = ControlCommand(Purpose.DRIVE, GuidedPosition(told), 1.5)
        return avoided(now, ReferencePath(round_it), view(1.0), (other,)).yields

    assert not yields(NedPoint(20.0, 22.0))
    assert yields(NedPoint(25.0, 24.0))


def test_who_makes_way_is_patient_for_a_while_and_anew_each_time() -> None:
    giver = CollisionAvoidance()
    assert not giver.is_patient(0.0, 30.0, yields=False)
    assert all(giver.is_patient(now_s, 30.0, yields=True) for now_s in (1.0, 10.0, 30.9))
    assert not giver.is_patient(31.0, 30.0, yields=True)
    assert not giver.is_patient(40.0, 30.0, yields=False)
    assert giver.is_patient(41.0, 30.0, yields=True), "it has got on meanwhile"


def test_the_middle_lies_along_the_way_also_where_it_rolls_back_or_turns_on_the_spot() -> None:
    on, back = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    assert middles_of(on, 0.5 * math.pi, 0.4) == pytest.approx(np.array([[0.0, 0.4], [0.0, 1.4], [1.4, 1.0]]))
    assert middles_of(back, 0.0, 0.4) == pytest.approx(np.array([[0.4, 0.0], [0.4, 0.0], [-0.6, 0.0]]))


@pytest.mark.parametrize(("ahead_m", "makes_way"), [(0.4, True), (-0.4, False)])
def test_only_where_the_outline_reaches_a_long_rover_is_in_the_way(ahead_m: float, makes_way: bool) -> None:
    """Something passes 1.6 m ahead of its place, 0.5 m in radius: its nose reaches 1.1 m ahead, or 0.3 m."""
    body = Footprint.rectangle(1.4, 0.6, ahead_m)
    at = replace(view(0.0), body=body, rover=RoverLimits(body.radius_m, 2.0, 8.0))
    option = avoided(stop_for(Purpose.BLOCKED), None, at, (crossing(-3.0, 1.2, north_m=21.6),))
    assert option.yields is makes_way


def test_in_the_way_of_a_van_and_told_to_look_it_drives_straight_on_out_of_the_way() -> None:
    """As in `crossing`: it was across the van's way when its beams showed no more; it stopped there, and was hit."""
    look = ControlCommand(Purpose.LOOK, GuidedHeading(math.radians(-90.0)), 0.5)
    here = Pose(23.665, 26.997, math.radians(-120.0), 100.0)
    van = Moving("van", 100.0, NedPoint(28.3, 26.0), -1.5, 0.0, 1.0)
    option = avoided(look, None, view(0.914, pose=here), (van,))
    assert isinstance(option.command.setpoint, GuidedPosition)
    there = option.command.setpoint.point
    assert here.point.bearing_rad(there) == pytest.approx(here.heading_rad), "straight on"
    assert 26.0 - there.east_m > 1.0 + ROVER.radius_m, "it stands beside the way of the van"


@pytest.mark.parametrize("speed_m_s", [0.5, 0.914, 1.5, 1.9])
def test_no_farther_straight_on_than_a_rover_with_thin_beams_may_be_told(speed_m_s: float) -> None:
    """The last look would refuse it, and tell the rover to stand in the way."""
    moment = view(speed_m_s, pose=Pose(23.665, 26.997, math.radians(-120.0), 100.0))
    moment = replace(moment, rover=replace(ROVER, narrow_sight=True))
    look = ControlCommand(Purpose.LOOK, GuidedHeading(math.radians(-90.0)), 0.5)
    option = avoided(look, None, moment, (Moving("van", 100.0, NedPoint(28.3, 26.0), -1.5, 0.0, 1.0),))
    assert fault_of(option.command.setpoint, moment, Bounds()) is None


def test_beside_what_is_near_already_it_goes_on_where_that_leaves_more_room() -> None:
    """As in `crossing`: half out of the way of a cart that said nothing of its size it stopped, and was touched."""
    here, speed_m_s = Pose(20.7, 20.396, math.radians(50.0), 100.0), 1.0
    cart = Moving("cart", 100.0, NedPoint(19.33, 19.99), 1.2, 0.0, 1.0)
    for stops, aside_rad in ((False, None), (True, None), (False, math.radians(45.0))):
        option = avoided(
            stop_for(Purpose.BLOCKED), None, view(speed_m_s, pose=here), (cart,), stops=stops, aside_rad=aside_rad
        )
        assert isinstance(option.command.setpoint, GuidedPosition), (stops, aside_rad)
        assert option.command.setpoint.point.east_m > here.east_m + 0.8


def test_while_it_makes_way_it_does_not_go_on_because_it_might_just_pass() -> None:
    """As in `crossing`: rolling beside the way of a sweeper, and told to back off, it went on for a moment."""
    here = Pose(24.14, 22.388, math.radians(-64.0), 100.0)
    ahead = np.column_stack((np.linspace(24.14, 25.4, 41), np.linspace(22.388, 12.4, 41)))
    on = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(24.46, 21.82)), 0.75)
    sweeper = Moving("sweeper", 100.0, NedPoint(25.0, 23.66), 0.0, -0.7, 1.0)
    at, line = view(0.43, pose=here), ReferencePath(ahead)
    assert avoided(on, line, at, (sweeper,)).command == on, "for the test to show anything"
    option = avoided(on, line, at, (sweeper,), makes_way=True)
    assert option.yields and option.command.setpoint != on.setpoint
