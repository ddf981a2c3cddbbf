"""The controller that plans motions, driving the model of a rover over ground drawn by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from companion.control import motion_controller
from companion.control.controller import ControlCommand, Purpose
from companion.control.following import AS_SHIPPED, Following, turn_gains, within_limits
from companion.control.local_view import LocalView
from companion.control.motion_controller import (
    FASTER_DRAGGED_M_S,
    MotionController,
    _faster_s,
    _latest,
    rover_model,
)
from companion.control.motion_ground import AROUND_M, Window, look_round
from companion.control.motion_kernels import MotionProblem, clearance_m, moved
from companion.control.motion_planners import Found, motion_planner
from companion.control.motion_prediction import braked_m
from companion.control.position_ahead import PositionAhead
from companion.control.reference_path import ReferencePath, advanced
from companion.control.standstill import STANDS_M_S
from companion.control.told import Told, ToldVelocity, after
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.distance_field import distance_field
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity, Setpoint
from tests.companion.control.test_motion_ground import PATH, ground, wall

FOOTPRINT = Footprint.rectangle(0.6, 0.4)
TICK_S = 0.05
GUARDED = Settings.model_validate({"guidance": {"controller": "motion-ga", "velocity_lasts_s": 0.3}})
STRICT = Settings.model_validate({"guidance": {"controller": "motion-ga"}})
KNOWN = AS_SHIPPED._replace(off_model=0.1, turn_off_model=0.1)


def view(evidence: EvidenceMap, pose: Pose, speed_m_s: float = 0.0, settings: Settings = GUARDED) -> LocalView:
    return LocalView(pose, speed_m_s, evidence, RoverLimits(FOOTPRINT.radius_m, 2.0, 8.0), settings)


def controller(seed: int = 0) -> MotionController:
    return MotionController(FOOTPRINT, motion_planner("motion-ga", seed))


def driven(
    evidence: EvidenceMap, seed: int, gain: float = 1.0, settings: Settings = GUARDED
) -> tuple[float, float, float]:
    """Drives until it is there or 30 s are over: how far from the end it is, how near it came to anything, seconds.

    ``gain``: the rover accelerates, brakes and turns by this factor more than its settings say.
    """
    leads, start = controller(seed), Pose(3.0, 10.0, 0.0, 0.0)
    body = leads._body
    blocked = evidence.log_odds >= evidence.settings.occupied_at
    gap_m = distance_field(blocked) * np.float32(evidence.evidence_m) - np.float32(0.5 * evidence.evidence_m)
    state, told, lately = (start.east_m, start.north_m, 0.0, 0.0, 0.0), [(0.0, 0.0)] * 6, Told()
    least_m, left_m, now_s, path = math.inf, math.inf, 0.0, PATH
    while now_s < 30.0 and left_m > 0.5:
        x, y, heading, speed, turn = state
        at = view(evidence, Pose(y, x, heading, now_s), abs(speed), settings)
        at = replace(at, yaw_rate_rad_s=turn, lately=lately, rolls_back=speed < 0.0)
        path = advanced(path, at.pose)
        setpoint = leads.follow(path, at).setpoint
        told.append(_as_velocity(setpoint, at.pose))
        lately = after(lately, setpoint, now_s)
        model = rover_model(at)
        model = model._replace(
            accel_m_s2=gain * model.accel_m_s2, decel_m_s2=gain * at.following.deceleration_m_s2,
            turn_accel_rad_s2=gain * model.turn_accel_rad_s2,
        )  # fmt: skip
        forward_m_s, turn_rad_s = told[-6]
        state = moved(state, forward_m_s, gain * turn_rad_s, model, TICK_S)
        now_s += TICK_S
        least_m = min(least_m, clearance_m(gap_m, evidence.evidence_m, body, state[0], state[1], state[2]))
        left_m = NedPoint(state[1], state[0]).distance_m(PATH.end)
    return left_m, least_m, now_s


def _as_velocity(setpoint: Setpoint, pose: Pose) -> tuple[float, float]:
    """What the autopilot makes of it: to a position as fast as it can stop there, turning to it within a second."""
    if isinstance(setpoint, GuidedVelocity):
        return setpoint.forward_m_s, setpoint.yaw_rate_rad_s
    assert isinstance(setpoint, GuidedPosition)
    aside_rad = math.remainder(pose.point.bearing_rad(setpoint.point) - pose.heading_rad, 2.0 * math.pi)
    return min(2.0, math.sqrt(pose.point.distance_m(setpoint.point))), min(max(aside_rad, -1.0), 1.0)


def posts(seed: int) -> EvidenceMap:
    """Twelve posts where the path leads through, none at its ends."""
    evidence, rng = ground(), np.random.default_rng(seed)
    for north_m, east_m in zip(rng.uniform(5.0, 15.0, 12), rng.uniform(7.0, 13.0, 12), strict=True):
        y, x = int(north_m / evidence.evidence_m), int(east_m / evidence.evidence_m)
        evidence.log_odds[y : y + 2, x : x + 2] = 3.0
    return evidence


@pytest.mark.parametrize("gain", [pytest.param(0.7, marks=pytest.mark.thorough), 1.3])
def test_it_gets_through_posts_and_touches_none_whatever_the_rover_is(gain: float) -> None:
    """Six grounds for each rover; the discs reach 2 cm beyond its sides."""
    results = [driven(posts(seed), seed, gain) for seed in range(6)]
    assert all(least_m > 0.0 for _, least_m, _ in results), results
    assert sum(left_m <= 0.5 for left_m, _, _ in results) >= 5, results
    assert np.median([seconds for left_m, _, seconds in results if left_m <= 0.5]) < 14.0


@pytest.mark.thorough
def test_without_a_guard_it_goes_slower_and_touches_nothing_either() -> None:
    guarded, strict = driven(posts(1), 1), driven(posts(1), 1, settings=STRICT)
    assert strict[1] > 0.0 and strict[2] > guarded[2]


def test_without_a_guard_a_position_leads_where_the_way_is_straight_and_wide() -> None:
    """It ends by itself, so that the rover may go faster than with a velocity that goes on for three seconds."""
    walled, pose = ground(), Pose(3.0, 10.0, 0.0, 1.0)
    wall(walled, 9.0, 0.0, 20.0)
    guarded = controller().follow(PATH, view(walled, pose, 1.0))
    strict, moment = controller(), view(walled, pose, 1.0, STRICT)
    ahead = strict.follow(PATH, moment)
    assert isinstance(guarded.setpoint, GuidedVelocity) and isinstance(ahead.setpoint, GuidedPosition)
    assert ahead.purpose is Purpose.DRIVE and ahead.speed_m_s > 1.5
    assert strict.choice is not None and strict.choice.ahead is ahead
    assert strict.choice.told.speed_m_s < ahead.speed_m_s - 0.3
    assert strict.foreseen(PATH, moment, np.array([0.0, 1.0])) is None, "it follows the path"


def test_on_open_ground_it_is_there_as_soon_without_a_guard() -> None:
    guarded, strict = driven(ground(), 0), driven(ground(), 0, settings=STRICT)
    assert guarded[0] < 0.5 and strict[0] < 0.5
    assert strict[2] < 1.15 * guarded[2]


def test_it_stops_before_ground_that_was_not_seen() -> None:
    evidence = ground()
    evidence.log_odds[round(8.0 / evidence.evidence_m) :] = 0.0
    leads, pose = controller(), Pose(6.5, 10.0, 0.0, 0.0)
    told = leads.follow(PATH, view(evidence, pose, 1.5)).setpoint
    assert isinstance(told, GuidedVelocity) and told.forward_m_s <= 0.2


@pytest.mark.parametrize("settings", [GUARDED, STRICT])
def test_ground_that_has_become_unknown_before_it_is_not_driven_onto(settings: Settings) -> None:
    """As where a map is looked at again. It brakes at once, and creeps no farther than it can see beside itself."""
    leads, evidence, lately, path = controller(), ground(), Told(), PATH
    north_m, speed_m_s, told_m_s, ended_m = 3.0, 1.5, [1.5] * 6, math.nan
    for tick in range(90):
        if tick == 4:
            evidence.log_odds[round((north_m + 0.9) / evidence.evidence_m) :] = 0.0
            ended_m = north_m + speed_m_s * 0.3 + speed_m_s**2 / 2.0
        at = replace(view(evidence, Pose(north_m, 10.0, 0.0, TICK_S * tick), speed_m_s, settings), lately=lately)
        path = advanced(path, at.pose)
        setpoint = leads.follow(path, at).setpoint
        assert isinstance(setpoint, GuidedVelocity)
        told_m_s.append(setpoint.forward_m_s)
        lately = after(lately, setpoint, at.pose.time_s)
        speed_m_s += min(max(told_m_s[-6] - speed_m_s, -TICK_S), TICK_S)
        north_m += speed_m_s * TICK_S
        assert tick < 5 or setpoint.forward_m_s < 0.3
    assert north_m < ended_m + 0.8


@pytest.mark.parametrize("settings", [GUARDED, STRICT])
def test_before_the_first_scan_it_stands_also_at_the_edge_of_the_map(settings: Settings) -> None:
    """There it lies over unseen ground already, behind it; that is no leave to drive onto more of it, ahead."""
    leads, evidence = controller(), ground()
    evidence.log_odds.fill(0.0)
    for north_m in (0.2, 3.0):
        at = view(evidence, Pose(north_m, 10.0, 0.0, 0.0), 0.0, settings)
        command = leads.follow(PATH, at)
        assert command.setpoint == GuidedVelocity(0.0, 0.0) and command.purpose is Purpose.BLOCKED


def test_a_rover_that_saw_nothing_behind_it_does_not_reverse_there() -> None:
    evidence = ground()
    evidence.log_odds[: round(9.5 / evidence.evidence_m)] = 0.0
    leads, back, state = controller(), ReferencePath(PATH.points[::-1].copy(), 28), (10.0, 10.0, 0.0, 0.0, 0.0)
    for tick in range(60):
        at = view(evidence, Pose(state[1], state[0], state[2], TICK_S * tick), abs(state[3]))
        at = replace(at, yaw_rate_rad_s=state[4], rolls_back=state[3] < 0.0)
        told = leads.follow(back, at).setpoint
        assert isinstance(told, GuidedVelocity)
        state = moved(state, told.forward_m_s, told.yaw_rate_rad_s, rover_model(at), TICK_S)
        assert math.hypot(state[0] - 10.0, state[1] - 10.0) < 0.6, "what it can turn on, and a little more"


def test_where_it_begins_it_goes_slower_over_ground_that_nobody_saw() -> None:
    """Of what is beside it nothing is known; one that came here on this map, looking ahead, would have seen it."""
    evidence = ground()
    evidence.log_odds.fill(0.0)
    wall(evidence, 10.0, 9.5, 10.5, -1.0)  # where it began, the ground is seen

    def fastest_m_s(*moves: tuple[float, float]) -> float:
        """``moves``: northings and forward speeds, half a second apart."""
        leads = controller()
        for number, (north_m, forward_m_s) in enumerate(((10.0, 0.0), *moves)):
            at = view(evidence, Pose(north_m, 10.0, 0.0, 0.5 * number), abs(forward_m_s))
            leads.follow(PATH, replace(at, rolls_back=forward_m_s < 0.0))
        assert leads.choice is not None
        return float(leads.choice.problem.admitted_m_s.max())

    ahead, back = ([(10.0 + way * 0.5 * step, way) for step in range(6)] for way in (1.0, -1.0))
    first_m_s, later_m_s = fastest_m_s((12.5, 0.0)), fastest_m_s(*ahead, (12.5, 0.0))
    assert 0.0 < first_m_s < 0.8 * later_m_s, "its position jumped there, or it drove there"
    assert fastest_m_s(*back, (7.5, 0.0)) == first_m_s, "tail first it saw nothing"
    wall(evidence, 10.0, 9.5, 10.5, 0.0)
    wall(evidence, 13.0, 7.5, 8.0, -1.0)  # else it would stand
    assert fastest_m_s(*ahead, (12.5, 0.0)) == first_m_s, "the map was begun anew"


def test_what_a_scan_shows_counts_in_the_tick_that_mapped_it() -> None:
    """The last look knows it in that tick, and would refuse what was chosen without it."""
    evidence, leads = ground(), controller()
    moment = view(evidence, Pose(6.5, 10.0, 0.0, 0.0), 1.5)
    open_m_s = leads.follow(PATH, replace(moment, scans=1)).speed_m_s
    wall(evidence, 8.0, 8.0, 12.0)
    at = replace(moment, pose=replace(moment.pose, time_s=TICK_S), scans=2)
    assert open_m_s > 1.5 and leads.follow(PATH, at).speed_m_s < 1.0


def test_what_is_told_allows_for_a_command_that_comes_later_than_the_model_says() -> None:
    """With the dead time off by as much as all else, it may be left alone only at a lower speed."""
    evidence = ground()
    wall(evidence, 5.8, 8.0, 12.0)
    fastest_m_s, lately = [], (ToldVelocity(-1.0, 1.5, 0.0),)
    for off_model in (0.0, 0.6):
        at = view(evidence, Pose(3.0, 10.0, 0.0, 0.0), 1.5)
        # It brakes as well as it should in both cases: only what comes late is compared.
        brakes_m_s2 = 1.0 / (1.0 - off_model)
        follows = at.following._replace(off_model=off_model, gains_most_m_s2=1.0, deceleration_m_s2=brakes_m_s2)
        at = replace(at, lately=lately, following=follows)
        leads = controller()
        leads.follow(PATH, at)
        assert leads.choice is not None
        fastest_m_s.append(leads.choice.problem.admitted_m_s[8, 0])
    assert fastest_m_s[1] < 0.9 * fastest_m_s[0]
    late = replace(at, following=at.following._replace(dead_s=0.25, off_model=0.3))
    assert _latest(late) == 7, "0.325 s, in steps of 0.05 s"


def test_shut_in_it_says_that_it_is_blocked() -> None:
    evidence = ground()
    for north_m in (2.5, 3.5):
        wall(evidence, north_m, 9.5, 10.6)
    for east_m in (9.5, 10.5):
        x = round(east_m / evidence.evidence_m)
        evidence.log_odds[round(2.5 / evidence.evidence_m) : round(3.6 / evidence.evidence_m), x] = 3.0
    leads, purposes = controller(), set()
    for tick in range(10):
        purposes.add(leads.follow(PATH, view(evidence, Pose(3.0, 10.0, 0.0, TICK_S * tick))).purpose)
    assert Purpose.BLOCKED in purposes


def test_it_turns_round_where_the_path_lies_behind() -> None:
    leads, pose = controller(), Pose(10.0, 10.0, math.pi, 0.0)
    turned, path, lately = [], ReferencePath(PATH.points, 28), Told()
    for tick in range(10):
        at = view(ground(), replace(pose, time_s=TICK_S * tick))
        told = leads.follow(path, replace(at, lately=lately)).setpoint
        assert isinstance(told, GuidedVelocity)
        turned.append(abs(told.yaw_rate_rad_s))
        lately = after(lately, told, at.pose.time_s)
    assert max(turned) > 0.5


def test_after_another_kind_of_setpoint_the_rover_counts_as_going_on() -> None:
    """No velocity was told in the dead time: that is no command to stop. A position tells the rover to drive on."""
    pose, slow = Pose(3.0, 10.0, 0.0, 0.0), ToldVelocity(-1.0, 0.5, 0.2)
    at = replace(view(ground(), pose, 1.0), yaw_rate_rad_s=0.3)
    cases = (
        (replace(at, lately=(slow,)), (0.5, 0.2)),
        (at, (1.0, 0.3)),
        (replace(at, rolls_back=True), (-1.0, 0.3)),
        (replace(at, told=GuidedPosition(PATH.end)), (2.0, 0.3)),
    )
    for seen, expected in cases:
        leads = controller()
        leads.follow(PATH, seen)
        assert leads.choice is not None
        pending = leads.choice.problem.pending
        assert len(pending) == 3 and np.all(pending == expected)


def test_it_foresees_what_it_told_and_then_the_path() -> None:
    leads, times_s = controller(), np.arange(0.0, 6.0, 0.2)
    at = view(ground(), Pose(3.0, 10.0, 0.0, 0.0), 1.0)
    assert leads.foreseen(PATH, at, times_s) is None
    leads.follow(PATH, at)
    places = leads.foreseen(PATH, at, times_s)
    assert places is not None and places.shape == (30, 2)
    steps_m = np.hypot(*np.diff(places, axis=0).T)
    assert np.hypot(*(places[0] - (3.0, 10.0))) < 0.01 and steps_m.max() < 0.45
    assert abs(places[-1, 1] - 10.0) < 0.3 and 11.0 < places[-1, 0] < 14.5
    assert leads.foreseen(PATH, replace(at, pose=replace(at.pose, time_s=1.0)), times_s) is None


def test_a_rover_that_the_ground_drags_is_told_little_more_than_its_speed() -> None:
    """Else the throttle opens wide, and the rover shoots ahead where such ground ends."""
    slow = view(ground(), Pose(3.0, 10.0, 0.0, 0.0), 0.6)
    for held_m_s, fastest_m_s in ((0.0, 2.0), (0.3, 2.0), (1.5, 0.6 + FASTER_DRAGGED_M_S)):
        leads, at = controller(), replace(slow, held_m_s=held_m_s)
        assert rover_model(at).fastest_m_s == pytest.approx(fastest_m_s)
        leads.follow(PATH, at)
        assert leads.choice is not None
        assert 0.5 < leads.choice.told.speed_m_s <= fastest_m_s


def test_it_foresees_no_better_braking_than_of_a_rover_that_is_told_to_stand() -> None:
    """Whatever is thought to be known of the brakes: else to go on seems to end sooner than to stop."""
    evidence = ground()
    wall(evidence, 5.2, 8.0, 12.0)
    hard = Following(deceleration_m_s2=2.2, off_model=0.1)
    leads, at = controller(), replace(view(evidence, Pose(3.0, 10.0, 0.0, 0.0), 1.9), following=hard)
    times_s = np.arange(0.0, 2.4, 0.2)
    leads.follow(PATH, at)
    assert leads.choice is not None and leads.choice.told.speed_m_s < 1.0
    places = leads.foreseen(PATH, at, times_s)
    assert places is not None
    rolled_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
    assert np.all(rolled_m[:8] >= braked_m(1.9, times_s, at.settings.guidance)[:8] - 0.15)


def test_it_knows_ways_to_stop_that_turn_off_where_the_ground_allows_them() -> None:
    """As far as braking straight on, and on the side it turns to; not towards a wall near by, nor a moment later."""
    free, walled, times_s = ground(), ground(), np.arange(0.0, 4.0, 0.2)
    rows, column = slice(int(2.0 / walled.evidence_m), int(7.0 / walled.evidence_m)), int(10.4 / walled.evidence_m)
    walled.log_odds[rows, column : column + 2] = 3.0
    turns = {}
    for evidence in (free, walled):
        leads, at = controller(), view(evidence, Pose(3.0, 10.0, 0.0, 0.0), 1.5)
        leads.follow(PATH, at)
        ways = list(leads.turned_stops(at, times_s))
        for command, places in ways:
            setpoint = command.setpoint
            assert isinstance(setpoint, GuidedVelocity) and setpoint.forward_m_s == 0.0
            assert np.sign(places[-1, 1] - 10.0) == np.sign(setpoint.yaw_rate_rad_s)
            rolled_m = np.hypot(*np.diff(places, axis=0).T).sum()
            assert rolled_m == pytest.approx(braked_m(1.5, times_s, at.settings.guidance)[-1], abs=0.25)
            assert places[-1, 0] - 3.0 < rolled_m
        turns[evidence is walled] = {float(np.sign(places[-1, 1] - 10.0)) for _, places in ways}
        later = replace(at, pose=replace(at.pose, time_s=0.1))
        assert not list(leads.turned_stops(later, times_s))
    assert turns == {False: {-1.0, 1.0}, True: {-1.0}}


@pytest.mark.parametrize(
    ("straight_m", "turned_m", "dragged_m_s", "turns"),
    [
        (-0.143, -0.127, 0.0, False),
        (-0.143, -0.1, 0.0, True),
        (-0.143, -0.1, 1.5, False),
        (-0.143, -0.02, 1.5, True),
        (-1.0, 0.02, 1.5, True),
        (0.01, 0.025, 0.0, False),
        (0.02, 0.045, 0.0, True),
        (0.02, 0.045, 1.5, True),
    ],
)
def test_it_turns_while_it_brakes_only_for_clearly_more_room(
    monkeypatch: pytest.MonkeyPatch, straight_m: float, turned_m: float, dragged_m_s: float, turns: bool
) -> None:
    """Where turning keeps room enough, any more of it is worth a turn: in a gap it must go on round its edge.

    Where ground drags the rover, and no way of braking is clear, how fast it will be is a guess: it brakes straight on.
    """
    evidence = ground()
    wall(evidence, 4.0, 8.0, 12.0)
    monkeypatch.setattr(
        motion_controller,
        "_braking_spares_m",
        lambda turns_rad_s, *_: np.where(turns_rad_s > 0.0, turned_m, straight_m),
    )
    leads = controller()
    at = replace(view(evidence, Pose(3.0, 10.0, 0.0, 0.0), 1.9), dragged_m_s=dragged_m_s)
    command = leads.follow(PATH, at)
    assert command.purpose is Purpose.BRAKE and leads.choice is not None
    assert (leads.choice.told.turn_rad_s > 0.0) is turns


def test_over_a_late_link_what_is_told_is_safe_whether_it_is_obeyed_late_or_soon() -> None:
    """A turn towards a wall is under way; if it comes sooner, the wall is nearer."""
    evidence = ground()
    wall(evidence, 4.5, 10.6, 13.0)
    told = tuple(ToldVelocity(0.05 * step, 1.5, 0.9 if step > 8 else 0.0) for step in range(-30, 17))
    admitted = []
    for soonest_s in (math.inf, 0.5):
        follows = Following(dead_s=0.7, off_model=0.1)
        at = view(evidence, Pose(3.0, 10.0, 0.0, 0.8), 1.5)
        at = replace(at, following=follows, soonest_s=soonest_s, lately=told)
        leads = controller()
        leads.follow(PATH, at)
        assert leads.choice is not None
        admitted.append(leads.choice.problem.admitted_m_s)
    assert np.all(admitted[1] <= admitted[0]) and admitted[1].sum() < 0.7 * admitted[0].sum()


def test_without_a_guard_what_is_told_is_safe_whether_it_is_obeyed_late_or_soon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A turn away from a wall has just been told off; if it ends sooner, three seconds later the wall is nearer."""
    evidence = ground()
    for north_m in np.arange(0.0, 20.0, evidence.evidence_m):
        wall(evidence, float(north_m), 8.6, 9.1)
    told = tuple(ToldVelocity(0.05 * step, 1.0, 0.9 if step < 12 else -0.2) for step in range(-30, 17))
    at = view(evidence, Pose(3.0, 10.0, 0.0, 0.8), 1.0, STRICT)
    at = replace(at, following=Following(dead_s=0.275, off_model=0.28), yaw_rate_rad_s=0.5, lately=told)
    admitted = []
    for problems in (motion_controller._sooner_or_later, lambda later, view: (later,)):
        monkeypatch.setattr(motion_controller, "_sooner_or_later", problems)
        leads = controller()
        leads.follow(PATH, at)
        assert leads.choice is not None
        admitted.append(leads.choice.problem.admitted_m_s)
    assert np.all(admitted[0] <= admitted[1]) and admitted[0].sum() < 0.9 * admitted[1].sum()


class Wants:
    """Stands in for a planner that always wants this speed and turn rate."""

    def __init__(self, speed_m_s: float, turn_rad_s: float = 0.0) -> None:
        self.wanted_m_s, self.turn_rad_s = speed_m_s, turn_rad_s
        self.forgotten = 0

    def plan(self, problem: MotionProblem, passed_s: float) -> Found:
        motion = np.zeros((6, 2))
        motion[:] = self.wanted_m_s, self.turn_rad_s
        return Found(motion, 1.0, motion[None], np.ones(1))

    def forget(self) -> None:
        self.forgotten += 1


def test_a_void_path_leaves_nothing_of_what_was_planned_seen_and_led_along_it(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, led = [], list[PositionAhead]()

    class Ahead(PositionAhead):
        def faster_than(self, speed_m_s: float, path: ReferencePath, view: LocalView) -> ControlCommand | None:
            led.append(self)
            return None

    def look(*args: Any, **more: Any) -> Window:
        looks.append(args)
        return look_round(*args, **more)

    monkeypatch.setattr(motion_controller, "PositionAhead", Ahead)
    monkeypatch.setattr(motion_controller, "look_round", look)
    planner = Wants(0.4)
    leads, at = MotionController(FOOTPRINT, planner), view(ground(), Pose(5.0, 10.0, 0.0, 0.0))
    for _ in range(2):
        leads.follow(PATH, at)
    assert (len(looks), planner.forgotten, led[0] is led[1]) == (1, 0, True), "the same moment, and the same path"
    leads.reset()
    leads.follow(PATH, at)
    assert (len(looks), planner.forgotten, led[1] is led[2]) == (2, 1, False)


def test_it_says_whether_the_rover_rolled_tail_first() -> None:
    """Who judges what comes across the way asks for it."""
    leads, at = controller(), view(ground(), Pose(5.0, 10.0, 0.0, 0.0), 0.3)
    for rolls_back in (True, False):
        leads.follow(PATH, replace(at, rolls_back=rolls_back))
        assert leads.backwards is rolls_back


def test_it_looks_as_far_as_where_the_rover_would_come_to_stand() -> None:
    """With the path behind it that lies beyond all else that is looked at."""
    path, leads = ReferencePath(PATH.points[:9][::-1].copy()), controller()
    at = view(ground(), Pose(8.0, 10.0, 0.0, 0.0), 2.0)
    leads.follow(path, at)
    assert leads.choice is not None
    seen = leads.choice.problem.ground
    north_m = leads.choice.corner.north_m + len(seen.gap_m) * seen.cell_m
    stops_m = 2.0**2 / (2.0 * at.following.deceleration_m_s2)
    assert north_m > 8.0 + AROUND_M + stops_m


def test_what_may_not_be_told_is_told_slower_on_the_same_arc() -> None:
    """Before a wall it would stand in time from a part of the speed."""
    evidence = ground()
    wall(evidence, 7.4, 5.0, 15.0)
    planner = Wants(1.8, 0.2)
    at = replace(view(evidence, Pose(5.0, 10.0, 0.0, 0.0), 0.5, STRICT), following=KNOWN)
    leads = MotionController(FOOTPRINT, planner)
    assert leads.follow(PATH, at).purpose is Purpose.DRIVE and leads.choice is not None
    told = leads.choice.told
    assert 0.1 < told.speed_m_s < 1.7 and told.turn_rad_s / told.speed_m_s == pytest.approx(0.2 / 1.8)


def test_a_rover_that_stands_and_may_be_told_nothing_is_blocked() -> None:
    """By its planner, that is: there is room to go on, which other motions would use."""
    evidence = ground()
    wall(evidence, 5.6, 5.0, 15.0)
    for speed_m_s, purpose in ((0.0, Purpose.BLOCKED), (0.3, Purpose.BRAKE)):
        at = view(evidence, Pose(5.0, 10.0, 0.0, 0.0), speed_m_s, STRICT)
        assert MotionController(FOOTPRINT, Wants(1.8)).follow(PATH, at).purpose is purpose


@pytest.mark.parametrize("wanted_m_s", [0.4, -0.4])
@pytest.mark.parametrize(("settings", "waits"), [(GUARDED, True), (STRICT, False)])
def test_a_rover_that_rolls_stands_before_it_is_told_to_go_the_other_way(
    wanted_m_s: float, settings: Settings, waits: bool
) -> None:
    """Else the autopilot's integral, full from braking, would push it on when it is told to stand again."""
    leads, found = MotionController(FOOTPRINT, Wants(wanted_m_s)), []
    for time_s, speed_m_s in ((0.0, 0.3), (0.1, 0.12), (0.15, 0.04), (0.2, 0.0), (0.32, 0.0)):
        at = view(ground(), Pose(5.0, 10.0, 0.0, time_s), speed_m_s, settings)
        leads.follow(PATH, replace(at, rolls_back=wanted_m_s > 0.0 and speed_m_s > STANDS_M_S))
        assert leads.choice is not None
        found.append(leads.choice.told.speed_m_s)
    then_m_s = 0.0 if waits else found[-1]
    assert found == [0.0, 0.0, then_m_s, then_m_s, pytest.approx(wanted_m_s, abs=0.3)] and found[-1] * wanted_m_s > 0.0
    at = replace(view(ground(), Pose(5.0, 10.0, 0.0, 0.4), 0.3, settings), rolls_back=wanted_m_s < 0.0)
    assert leads.follow(PATH, at).purpose is Purpose.DRIVE


@pytest.mark.parametrize("wanted_m_s", [0.4, -0.4])
def test_a_rover_that_never_seems_to_stand_is_told_to_go_on_after_two_seconds(wanted_m_s: float) -> None:
    leads, found = MotionController(FOOTPRINT, Wants(wanted_m_s)), []
    for tick in range(60):
        at = view(ground(), Pose(5.0, 10.0, 0.0, 0.05 * tick), 0.3 if tick < 10 else 0.07)
        leads.follow(PATH, replace(at, rolls_back=wanted_m_s > 0.0))
        assert leads.choice is not None
        found.append(leads.choice.told.speed_m_s)
    assert found == [0.0] * 49 + [wanted_m_s] * 11


@pytest.mark.parametrize(("settings", "told_m_s"), [(GUARDED, [0.0, 0.0, 0.0, 0.06, 0.06]), (STRICT, [0.06] * 5)])
def test_a_rover_that_is_to_creep_stands_first(settings: Settings, told_m_s: list[float]) -> None:
    """The same integral pushes it back through standing (0.19 m/s for a second), unless it was told to stand."""
    leads, found = MotionController(FOOTPRINT, Wants(0.06)), []
    for time_s, speed_m_s in ((0.0, 0.3), (0.1, 0.08), (0.2, 0.04), (0.35, 0.04), (0.4, 0.08)):
        leads.follow(PATH, view(ground(), Pose(5.0, 10.0, 0.0, time_s), speed_m_s, settings))
        assert leads.choice is not None
        found.append(leads.choice.told.speed_m_s)
    assert found == told_m_s


def test_a_rover_that_brakes_hard_is_told_to_go_the_other_way_at_once() -> None:
    """It stands within a moment: no integral has had the time to fill."""
    at = replace(view(ground(), Pose(5.0, 10.0, 0.0, 0.0), 0.3), rolls_back=True)
    for brakes_m_s2, purpose in ((2.0, Purpose.BRAKE), (4.0, Purpose.DRIVE)):
        hard = replace(at, following=at.following._replace(deceleration_m_s2=brakes_m_s2))
        assert MotionController(FOOTPRINT, Wants(0.4)).follow(PATH, hard).purpose is purpose


@pytest.mark.parametrize("onward", [1.0, -1.0])
def test_a_rover_that_rolls_the_other_way_though_it_is_told_to_stand_is_told_to_go_against_it(onward: float) -> None:
    """One that brakes better than it is let stands before the autopilot aims at zero: then the integral drives it."""
    planner = Wants(0.4 * onward)
    leads, found = MotionController(FOOTPRINT, planner), []
    for time_s, onward_m_s in ((0.0, 0.4), (0.1, 0.3), (0.2, -0.09), (0.25, -0.12), (0.3, -0.12), (0.35, -0.09)):
        at = view(ground(), Pose(5.0, 10.0, 0.0, time_s), abs(onward_m_s))
        leads.follow(PATH, replace(at, rolls_back=onward_m_s * onward < 0.0))
        planner.wanted_m_s = 0.0
        assert leads.choice is not None
        found.append(leads.choice.told.speed_m_s)
    assert found == [0.4 * onward, 0.0, 0.0, 0.2 * onward, 0.2 * onward, 0.0]


@pytest.mark.parametrize(
    ("brakes_m_s2", "walled", "told_m_s"), [(2.0, False, 0.2), (2.0, True, 0.0), (4.0, False, 0.0)]
)
def test_it_does_not_go_against_it_into_something_nor_where_it_brakes_hard(
    brakes_m_s2: float, walled: bool, told_m_s: float
) -> None:
    """Without a guard that goes on for three seconds: 0.5 m."""
    evidence, planner = ground(), Wants(0.4)
    leads, at = MotionController(FOOTPRINT, planner), view(ground(), Pose(5.0, 10.0, 0.0, 0.0), 0.4, STRICT)
    at = replace(at, following=at.following._replace(deceleration_m_s2=brakes_m_s2))
    leads.follow(PATH, at)
    planner.wanted_m_s = 0.0
    leads.follow(PATH, replace(at, pose=replace(at.pose, time_s=0.05)))
    if walled:
        wall(evidence, 5.6, 8.0, 12.0)
    rolls = replace(at, pose=replace(at.pose, time_s=0.1), speed_m_s=0.12, rolls_back=True, evidence=evidence)
    leads.follow(PATH, rolls)
    assert leads.choice is not None and leads.choice.told.speed_m_s == told_m_s


def test_what_it_rolled_before_others_led_it_is_no_roll_to_go_against() -> None:
    """Told to go back once, and then driven ahead by a pilot or while it makes way: it is only to stand."""
    planner = Wants(-0.4)
    leads = MotionController(FOOTPRINT, planner)
    leads.follow(PATH, replace(view(ground(), Pose(5.0, 10.0, 0.0, 0.0), 0.3), rolls_back=True))
    planner.wanted_m_s = 0.0
    leads.follow(PATH, view(ground(), Pose(5.0, 10.0, 0.0, 0.1), 0.0))
    for time_s in (5.0, 5.05, 5.1):
        command = leads.follow(PATH, view(ground(), Pose(5.0, 10.0, 0.0, time_s), 1.2))
        assert command.purpose is Purpose.BRAKE and command.setpoint == GuidedVelocity(0.0, 0.0)


def test_it_foresees_that_it_backs_off() -> None:
    """Before a wall, with the path behind it, it begins tail first or turns: not on towards the wall."""
    evidence = ground()
    wall(evidence, 3.6, 8.0, 12.0)
    path, leads = ReferencePath(PATH.points[::-1].copy(), 50), controller()
    at = view(evidence, Pose(3.2, 10.0, 0.0, 0.0))
    command = leads.follow(path, at)
    places = leads.foreseen(path, at, np.arange(0.0, 2.0, 0.2))
    assert command.purpose is Purpose.DRIVE and places is not None
    assert places[:, 0].max() < 3.35


def test_a_seed_gives_the_same_commands() -> None:
    told = []
    for _ in range(2):
        leads = controller(5)
        told.append([leads.follow(PATH, view(posts(2), Pose(3.0, 10.0, 0.0, TICK_S * i))) for i in range(5)])
    assert told[0] == told[1]


def test_no_motion_is_faster_or_turns_faster_than_the_autopilot_lets_it() -> None:
    """Whatever speed the target has: the limits are kept apart from it."""
    at = view(ground(), Pose(3.0, 10.0, 0.0, 0.0)).with_speeds(3.5, 3.5)
    free, limits = rover_model(at), {"WP_SPEED": 1.2, "ATC_STR_RAT_MAX": 30.0}
    held = rover_model(replace(at, rover=within_limits(at.rover, limits)))
    assert free.fastest_m_s == 3.5 and free.turn_fastest_rad_s == at.settings.motion.turn_rad_s
    assert held.fastest_m_s == 1.2 and held.turn_fastest_rad_s == pytest.approx(math.radians(30.0))


def test_without_a_guard_a_rover_keeps_more_room_and_more_of_it_in_turns() -> None:
    """Three seconds of a turn: small errors add up, and so does the drift of the position; and what is farther away is
    known less well where a reading speaks for a wide angle."""
    strict = replace(view(ground(), Pose(3.0, 10.0, 0.0, 1.0), 0.5, STRICT), following=KNOWN)
    short, long = (turn_gains(KNOWN, one.guidance.velocity_lasts_s) for one in (GUARDED, STRICT))
    assert max(long) == pytest.approx(max(short) + 0.1) and min(long) == pytest.approx(min(short) - 0.1)
    fine, wide = (replace(strict, rover=replace(strict.rover, beam_rad=math.radians(deg))) for deg in (0.5, 5.0))
    assert _faster_s(fine) == pytest.approx(_faster_s(replace(fine, settings=GUARDED)) + 0.1)
    assert _faster_s(wide) == pytest.approx(_faster_s(replace(wide, settings=GUARDED)) + 0.1 + math.radians(5.0))


@pytest.mark.parametrize(
    ("beam_deg", "room_s"), [(0.4, 0.04), (0.8, 0.04), (1.9, 0.04), (2.5, 0.0502), (3.75, 0.0753), (45.0, 0.2007)]
)
def test_beside_a_guarded_rover_so_much_more_room_is_kept_for_each_m_s(beam_deg: float, room_s: float) -> None:
    at = replace(view(ground(), Pose(3.0, 10.0, 0.0, 1.0), 0.5, GUARDED), following=KNOWN)
    seen = replace(at, rover=replace(at.rover, beam_rad=math.radians(beam_deg)))
    assert _faster_s(seen) == pytest.approx(room_s, abs=1e-4)


def test_on_ground_that_drags_it_goes_slower_where_it_could_not_stop_if_that_ground_ended() -> None:
    evidence = ground()
    wall(evidence, 9.0, 0.0, 20.0)
    path = ReferencePath(np.array(((3.0, 10.0), (8.0, 10.0))))
    held = view(evidence, Pose(5.5, 10.0, 0.0, 1.0), 0.8)
    fast, slow = (controller().follow(path, one).setpoint for one in (held, replace(held, dragged_m_s=1.5)))
    assert isinstance(fast, GuidedVelocity) and isinstance(slow, GuidedVelocity)
    assert fast.forward_m_s > 0.5 > slow.forward_m_s + 0.3
