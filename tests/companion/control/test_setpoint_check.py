"""The last look at a setpoint, against a slow reading of the same map; and that it really stands before the line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import settings as runs
from hypothesis import strategies as st

from companion.control.braking import braking_distance_m, farthest_m
from companion.control.controller import STOP, ControlCommand, Purpose
from companion.control.local_view import LocalView
from companion.control.safe_reach import BACK_LEAST_M_S, backing_speed_m_s
from companion.control.setpoint_check import SetpointCheck, fault_of, inside_borders
from companion.control.told import Told, ToldVelocity
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.core.severity import Severity
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mission.bounds import Bound, Bounds
from companion.safety.reasons import Reason, SetpointFault
from companion.settings import Settings
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint
from tests.support.notices import Notices
from tests.support.quick import examples
from tests.support.rig import Rig, yard
from tests.support.stored import KEEP_IN, POLYGONS, box, stored

SETTINGS = Settings()
RADIUS_M = 0.35
SIDE = 16
MIDDLE = 0.5 * SIDE


def open_ground() -> EvidenceMap:
    """All of it seen free."""
    evidence = new_map(empty_grid(SIDE, SIDE), RADIUS_M, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    return evidence


@dataclass(frozen=True)
class Output:
    """A setpoint that is about to be sent, and the rover at this moment."""

    setpoint: Setpoint
    pose: Pose
    speed_m_s: float


def view(evidence: EvidenceMap, pose: Pose, speed_m_s: float = 0.0) -> LocalView:
    return LocalView(pose, speed_m_s, evidence, RoverLimits(RADIUS_M, 2.0, 8.0), SETTINGS)


def fault(output: Output, evidence: EvidenceMap, *bounds: Bound) -> SetpointFault | None:
    found = fault_of(output.setpoint, view(evidence, output.pose, output.speed_m_s), Bounds(bounds))
    return None if found is None else found.kind


def test_a_position_is_not_behind_the_wall_into_which_the_rover_would_overshoot() -> None:
    evidence, pose = open_ground(), Pose(4.0, MIDDLE, 0.0, 0.0)
    patched(evidence, 8.0, MIDDLE - 2.0, 4.0, 3.0)
    for distance_m, kind in ((3.3, None), (3.6, SetpointFault.BEHIND_OBSTACLE)):
        there = GuidedPosition(NedPoint(4.0 + distance_m, MIDDLE))
        assert fault(Output(there, pose, 0.0), evidence) is kind
    held = replace(view(evidence, pose), held_m_s=1.0)
    found = fault_of(GuidedPosition(NedPoint(6.7, MIDDLE)), held, Bounds(()))
    assert found is not None and found.kind is SetpointFault.BEHIND_OBSTACLE


@pytest.mark.parametrize(
    ("setpoint", "kind"),
    [
        (GuidedHeading(0.5 * math.pi), SetpointFault.TURNS_INTO_OBSTACLE),
        (GuidedHeading(0.1), None),
        (GuidedPosition(NedPoint(MIDDLE + 1.5, MIDDLE - 2.0)), SetpointFault.TURNS_INTO_OBSTACLE),
        (GuidedPosition(NedPoint(MIDDLE + 2.0, MIDDLE)), None),
    ],
)
@pytest.mark.parametrize("planned", [True, False])
def test_a_rover_does_not_turn_its_corners_into_something(
    setpoint: Setpoint, kind: SetpointFault | None, planned: bool
) -> None:
    """On its own outline where motions are planned; where points lead the map keeps the circle round it."""
    evidence = open_ground()
    for north_m, east_m in ((0.65, 0.6), (-0.75, 0.45)):
        y, x = (math.floor((MIDDLE + v) / evidence.evidence_m) for v in (north_m, east_m))
        evidence.log_odds[y, x] = 3.0
    at = replace(view(evidence, Pose(MIDDLE, MIDDLE, 0.0, 0.0)), body=Footprint.rectangle(2.0, 0.5))
    if planned:
        at = replace(at, settings=Settings.model_validate({"guidance": {"controller": "motion-ga"}}))
    found = fault_of(setpoint, at, Bounds(()))
    assert (None if found is None else found.kind) is (kind if planned else None)


def test_the_way_to_a_position_is_as_wide_as_the_rover_not_as_what_the_map_keeps() -> None:
    """Where motions are planned the map keeps more room, and a position is chosen with the rover's own."""
    evidence = new_map(empty_grid(SIDE, SIDE), RADIUS_M + 0.1, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    there, pose = GuidedPosition(NedPoint(8.0, MIDDLE)), Pose(4.0, MIDDLE, 0.0, 0.0)
    for beside_m, kind in ((RADIUS_M + 0.05, None), (RADIUS_M - 0.1, SetpointFault.BEHIND_OBSTACLE)):
        near = evidence.log_odds.copy()
        patched(evidence, 6.0, MIDDLE + beside_m, 0.1, 2.0)
        assert fault(Output(there, pose, 0.0), evidence) is kind
        evidence.log_odds[:] = near


def patched(evidence: EvidenceMap, north_m: float, east_m: float, size_m: float, value: float) -> None:
    y, x = (round(v / evidence.evidence_m) for v in (north_m, east_m))
    size = max(1, round(size_m / evidence.evidence_m))
    evidence.log_odds[max(0, y) : y + size, max(0, x) : x + size] = value


@st.composite
def grounds(draw) -> EvidenceMap:
    """Patches that nobody has seen, and some things that stand there."""
    evidence, place = open_ground(), st.floats(0.0, SIDE - 1.0)
    for value, most, size in ((0.0, 4, st.floats(0.3, 3.0)), (2.0, 6, st.floats(0.1, 0.8))):
        for _ in range(draw(st.integers(0, most))):
            patched(evidence, draw(place), draw(place), draw(size), value)
    return evidence


def outputs(setpoint: st.SearchStrategy[Setpoint]) -> st.SearchStrategy[Output]:
    near = st.floats(MIDDLE - 2.0, MIDDLE + 2.0)
    poses = st.builds(Pose, near, near, st.floats(-math.pi, math.pi), st.just(0.0))
    return st.builds(Output, setpoint, poses, st.floats(0.0, 2.0))


ANYWHERE = st.floats(-3.0, SIDE + 3.0)
POSITIONS = outputs(st.builds(GuidedPosition, st.builds(NedPoint, ANYWHERE, ANYWHERE)))
VELOCITIES = outputs(st.builds(GuidedVelocity, st.floats(-2.0, 2.0), st.floats(-0.8, 0.8)))


def places_of(evidence: EvidenceMap, occupied: bool) -> np.ndarray:
    """Middles of the cells where something stands, or which nobody has seen; columns north, east."""
    at = evidence.log_odds >= evidence.settings.occupied_at if occupied else evidence.log_odds == 0.0
    return (np.argwhere(at) + 0.5) * evidence.evidence_m


def gap_m(places: np.ndarray, north_m: float, east_m: float) -> float:
    return float(np.hypot(places[:, 0] - north_m, places[:, 1] - east_m).min()) if len(places) else math.inf


@runs(max_examples=examples(400), deadline=None)
@given(grounds(), POSITIONS)
def test_a_position_that_passes_is_near_and_the_way_there_clear_and_seen(evidence: EvidenceMap, output: Output) -> None:
    assert isinstance(output.setpoint, GuidedPosition)
    pose, there = output.pose, output.setpoint.point
    standing, unseen = places_of(evidence, True), places_of(evidence, False)
    if gap_m(standing, pose.north_m, pose.east_m) < RADIUS_M + 0.2 or fault(output, evidence):
        return
    distance_m = pose.point.distance_m(there)
    assert distance_m <= farthest_m(output.speed_m_s, SETTINGS.guidance) + 0.1
    braking_m = 0.5 * 0.25 + 0.5**2 / 1.6
    for along_m in np.arange(0.0, distance_m - 0.1, 0.05):
        share = along_m / distance_m
        north_m = pose.north_m + share * (there.north_m - pose.north_m)
        east_m = pose.east_m + share * (there.east_m - pose.east_m)
        assert (0.0 <= north_m <= SIDE and 0.0 <= east_m <= SIDE) or along_m >= distance_m - braking_m - 0.15
        assert gap_m(standing, north_m, east_m) > RADIUS_M - 1e-6
        if along_m < distance_m - braking_m - 0.15:
            assert gap_m(unseen, north_m, east_m) > 0.5 * evidence.evidence_m - 0.06


@runs(max_examples=examples(400), deadline=None)
@given(grounds(), VELOCITIES)
def test_a_velocity_that_passes_can_be_stopped_on_its_arc(evidence: EvidenceMap, output: Output) -> None:
    assert isinstance(output.setpoint, GuidedVelocity)
    pose, speed_m_s = output.pose, output.setpoint.forward_m_s
    standing = places_of(evidence, True)
    if gap_m(standing, pose.north_m, pose.east_m) < RADIUS_M + 0.3 or fault(output, evidence):
        return
    north_m, east_m = pose.north_m, pose.east_m
    course_rad = pose.heading_rad + (math.pi if speed_m_s < 0.0 else 0.0)
    curvature_per_m = output.setpoint.yaw_rate_rad_s / max(output.speed_m_s, 1.0)
    alone_m = abs(speed_m_s) * 3.25 + speed_m_s**2 / 1.6
    for _ in np.arange(0.0, alone_m - 0.1 - evidence.evidence_m, 0.02):
        north_m, east_m = north_m + 0.02 * math.cos(course_rad), east_m + 0.02 * math.sin(course_rad)
        course_rad += 0.02 * curvature_per_m
        assert gap_m(standing, north_m, east_m) > RADIUS_M - 0.05 - evidence.evidence_m


CELLS = st.sets(st.tuples(st.integers(0, SIDE - 1), st.integers(0, SIDE - 1)), max_size=60)


@runs(max_examples=examples(400), deadline=None)
@given(grounds(), CELLS, POSITIONS)
def test_backing_out_asks_for_nothing_that_is_refused(
    evidence: EvidenceMap, closed: set[tuple[int, int]], output: Output
) -> None:
    """Neither fences nor what stands there: also where the rover stands close beside closed fields, or in one."""
    for x, y in closed:
        evidence.base.weights[y, x] = 1.0
    speed_m_s = backing_speed_m_s(view(evidence, output.pose, output.speed_m_s))
    back = replace(output, setpoint=GuidedVelocity(-speed_m_s, 0.0))
    assert speed_m_s < BACK_LEAST_M_S or fault(back, evidence) is None


def test_on_open_ground_it_backs_out_as_fast_as_it_may() -> None:
    back_m_s = backing_speed_m_s(view(open_ground(), Pose(MIDDLE, MIDDLE, 0.7, 0.0)))
    assert back_m_s == SETTINGS.guidance.back_out_speed_m_s


@runs(max_examples=examples(200), deadline=None)
@given(POSITIONS)
def test_on_open_ground_that_was_seen_only_distance_and_the_edge_of_the_map_count(output: Output) -> None:
    assert isinstance(output.setpoint, GuidedPosition)
    there = output.setpoint.point
    distance_m = output.pose.point.distance_m(there)
    inside = 0.0 < there.north_m < SIDE and 0.0 < there.east_m < SIDE
    if inside:
        assert bool(fault(output, open_ground())) == (
            distance_m > farthest_m(output.speed_m_s, SETTINGS.guidance) + 0.1
        )


@pytest.mark.parametrize("setpoint", [STOP, GuidedVelocity(0.0, 0.5), GuidedHeading(1.0)])
def test_standing_and_turning_on_the_spot_always_pass(setpoint: Setpoint) -> None:
    evidence = open_ground()
    patched(evidence, MIDDLE - 1.0, MIDDLE - 1.0, 2.0, 2.0)
    assert fault(Output(setpoint, Pose(MIDDLE, MIDDLE, 0.0, 0.0), 0.0), evidence) is None


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_a_number_does_not_pass(value: float) -> None:
    pose = Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    for setpoint, kind in (
        (GuidedPosition(NedPoint(value, 1.0)), SetpointFault.BEYOND_HORIZON),
        (GuidedVelocity(value, 0.0), SetpointFault.NOT_A_NUMBER),
        (GuidedVelocity(1.0, value), SetpointFault.NOT_A_NUMBER),
        (GuidedVelocity(0.0, value), SetpointFault.NOT_A_NUMBER),
    ):
        assert fault(Output(setpoint, pose, 0.0), open_ground()) is kind


def test_the_faults_have_names() -> None:
    pose = Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    ahead = Output(GuidedPosition(NedPoint(MIDDLE + 5.0, MIDDLE)), pose, 0.0)
    evidence = open_ground()
    patched(evidence, MIDDLE + 2.0, MIDDLE - 1.0, 2.0, 0.0)
    assert fault(ahead, evidence) is SetpointFault.ON_UNSEEN_GROUND
    patched(evidence, MIDDLE + 2.0, MIDDLE - 1.0, 2.0, 2.0)
    assert fault(ahead, evidence) is SetpointFault.BEHIND_OBSTACLE
    fast = Output(GuidedVelocity(2.0, 0.0), pose, 2.0)
    assert fault(fast, evidence) is SetpointFault.INTO_OBSTACLE


@pytest.mark.parametrize(("beyond_m", "refused"), [(-0.05, False), (0.05, False), (0.25, True)])
def test_a_position_may_lie_beyond_seen_ground_by_the_way_of_the_slowest_rover(beyond_m: float, refused: bool) -> None:
    evidence, pose = open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    evidence.log_odds[round((MIDDLE + 3.0) / evidence.evidence_m) :] = 0.0
    creep_m = braking_distance_m(SETTINGS.guidance.min_speed_m_s, SETTINGS.guidance)
    there = NedPoint(MIDDLE + 3.0 + creep_m + beyond_m, MIDDLE)
    assert bool(fault(Output(GuidedPosition(there), pose, 0.0), evidence)) is refused


@pytest.mark.parametrize(("speed_m_s", "refused"), [(0.0, (True, False)), (1.0, (True, False)), (2.0, (False, True))])
def test_the_arc_of_a_turn_rate_is_as_wide_as_the_speed_makes_it(speed_m_s: float, refused: tuple[bool, bool]) -> None:
    """At 0.8 rad/s: a post on the arc of 1 m/s, which is that of slower ones, too; and one on the arc of 2 m/s."""
    pose, found = Pose(MIDDLE, MIDDLE, 0.0, 0.0), []
    for curvature_per_m in (0.8, 0.4):
        evidence, half_rad = open_ground(), 0.5 * curvature_per_m * 1.9
        post = pose.point.moved(half_rad, 1.9 * float(np.sinc(half_rad / math.pi)))
        patched(evidence, post.north_m, post.east_m, 0.1, 2.0)
        found.append(bool(fault(Output(GuidedVelocity(0.7, 0.8), pose, speed_m_s), evidence)))
    assert tuple(found) == refused


def test_a_velocity_may_lead_past_a_thing_closer_than_the_room_that_controllers_keep_but_not_into_it() -> None:
    pose = Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    for aside_m, refused in ((0.25, True), (0.42, False)):
        evidence = open_ground()
        evidence.log_odds[
            round((MIDDLE + 1.0) / evidence.evidence_m), int((MIDDLE + aside_m) / evidence.evidence_m)
        ] = 2.0
        assert bool(fault(Output(GuidedVelocity(0.5, 0.0), pose, 0.0), evidence)) is refused


def test_a_rover_at_a_wall_may_leave_it() -> None:
    evidence = open_ground()
    evidence.log_odds[: round(MIDDLE / evidence.evidence_m)] = 2.0
    assert fault(Output(GuidedVelocity(0.5, 0.0), Pose(MIDDLE, MIDDLE, 0.0, 0.0), 0.0), evidence) is None


@pytest.mark.parametrize(("deep_m", "kind"), [(0.012, None), (0.03, None), (0.05, SetpointFault.BEHIND_OBSTACLE)])
def test_a_position_may_lead_past_a_thing_as_near_as_guidance_does(deep_m: float, kind: SetpointFault | None) -> None:
    """Guidance comes nearer than its radius by a tenth of a cell, where it stands beside something already."""
    evidence = open_ground()
    side_m = evidence.evidence_m
    y, x = (int((MIDDLE + off_m) / side_m) for off_m in (1.0, 0.3))
    evidence.log_odds[y, x] = 3.0
    pose = Pose(MIDDLE, (x + 0.5) * side_m - (RADIUS_M + 0.5 * side_m - deep_m), 0.0, 0.0)
    assert fault(Output(GuidedPosition(NedPoint(MIDDLE + 2.0, pose.east_m)), pose, 0.0), evidence) is kind


def test_a_target_at_the_farthest_distance_passes() -> None:
    for beyond_m, refused in ((0.0, False), (0.2, True)):
        pose = Pose(0.5, MIDDLE, 0.0, 0.0)
        there = GuidedPosition(NedPoint(0.5 + farthest_m(0.0, SETTINGS.guidance) + beyond_m, MIDDLE))
        assert bool(fault(Output(there, pose, 0.0), open_ground())) is refused


PLANNED = Settings.model_validate({"guidance": {"controller": "motion-ga", "velocity_lasts_s": 0.3}})


def rolling(speed_m_s: float, *, back: bool = False, lately: Told = ()) -> LocalView:
    """Towards a wall 1.5 m ahead, with planned motions."""
    evidence = open_ground()
    evidence.log_odds[round((MIDDLE + 1.5) / evidence.evidence_m)] = 3.0
    at = view(evidence, Pose(MIDDLE, MIDDLE, 0.0, 0.0), speed_m_s)
    return replace(at, settings=PLANNED, rolls_back=back, lately=lately)


def test_to_go_back_is_to_brake_first_and_is_looked_at_from_where_the_rover_stands() -> None:
    """Its direction is that of its velocity, not of what it was told."""
    told = (ToldVelocity(-0.1, -0.5, 0.0),)
    for back_m_s, refused in ((-0.1, False), (-1.0, True)):
        at = rolling(2.0, lately=told)
        at.evidence.log_odds[round((MIDDLE - 0.6) / at.evidence.evidence_m)] = 3.0
        at.evidence.log_odds[round((MIDDLE + 1.5) / at.evidence.evidence_m)] = -1.0
        found = fault_of(GuidedVelocity(back_m_s, 0.0), replace(at, rolls_back=True, speed_m_s=0.1), Bounds())
        assert bool(found) is refused
        assert fault_of(GuidedVelocity(back_m_s, 0.0), at, Bounds()) is None, "it stands 3 m farther ahead"
    assert fault_of(GuidedVelocity(-0.5, 0.0), rolling(2.0, lately=told), Bounds()) is None
    assert fault_of(GuidedVelocity(0.5, 0.0), rolling(2.0, lately=told), Bounds()) is not None


@pytest.mark.parametrize("walled", [False, True])
def test_a_rover_that_cannot_stop_in_time_may_go_back_but_not_into_what_stands_behind_it(walled: bool) -> None:
    """It brakes all the same; then it goes back for what is left of three seconds."""
    at = rolling(0.5)
    at.evidence.log_odds[round((MIDDLE + 0.5) / at.evidence.evidence_m)] = 3.0
    if walled:
        at.evidence.log_odds[round((MIDDLE - 1.2) / at.evidence.evidence_m)] = 3.0
    at = replace(at, settings=Settings.model_validate({"guidance": {"controller": "motion-ga"}}))
    assert fault_of(GuidedVelocity(0.3, 0.0), at, Bounds()) is not None
    assert (fault_of(GuidedVelocity(-1.0, 0.0), at, Bounds()) is not None) is walled


def test_what_was_told_lately_is_counted_until_a_new_velocity_shows() -> None:
    faster, slower = (ToldVelocity(-0.3, 2.0, 0.0),), (ToldVelocity(-0.3, 0.0, 0.0),)
    wanted = GuidedVelocity(0.6, 0.0)
    assert fault_of(wanted, rolling(1.2, lately=slower), Bounds()) is None
    assert fault_of(wanted, rolling(1.2, lately=faster), Bounds()) == Reason(SetpointFault.INTO_OBSTACLE)


def test_a_rover_that_may_brake_badly_is_told_to_earlier() -> None:
    at = rolling(1.2, lately=(ToldVelocity(-0.3, 1.2, 0.0),))
    good, bad = (replace(at, following=at.following._replace(off_model=off)) for off in (0.0, 0.5))
    assert fault_of(GuidedVelocity(0.05, 0.0), good, Bounds()) is None
    assert fault_of(GuidedVelocity(0.05, 0.0), bad, Bounds()) == Reason(SetpointFault.INTO_OBSTACLE)


def test_any_velocity_but_zero_is_looked_along() -> None:
    evidence, pose = open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    patched(evidence, MIDDLE - 1.0, MIDDLE - 1.0, 0.1, 2.0)
    evidence.log_odds[: round((MIDDLE - 0.9) / evidence.evidence_m)] = 2.0
    for forward_m_s in (-1.0, -0.5):
        assert fault(Output(GuidedVelocity(forward_m_s, 0.0), pose, 0.0), evidence)


@pytest.mark.parametrize(
    ("row", "column", "by", "kind"),
    [
        (0, 0, "experience", None),
        (1, 0, "experience", SetpointFault.INTO_OBSTACLE),
        (0, 1, "experience", SetpointFault.INTO_OBSTACLE),
        (0, 0, "the mission", SetpointFault.INTO_OBSTACLE),
    ],
)
def test_a_rover_crosses_the_field_that_it_stands_in_if_only_experience_closed_it(
    row: int, column: int, by: str, kind: SetpointFault | None
) -> None:
    """As guidance does on arcs. It begins in a corner of its field and would end 0.9 m or 1.9 m farther on."""
    evidence, pose = open_ground(), Pose(MIDDLE + 0.1, MIDDLE + 0.1, 0.5 * math.pi * column, 0.0)
    closed = evidence.penalty if by == "experience" else evidence.base.weights
    closed[int(MIDDLE) + row, int(MIDDLE) + column] = 1.0
    forward_m_s = 0.3 if kind is None or by == "the mission" else 0.6
    assert fault(Output(GuidedVelocity(forward_m_s, 0.0), pose, 0.0), evidence) is kind


@pytest.mark.parametrize("forward_m_s", [0.2, 0.3, 0.45, 0.8, -0.1, -0.3, -0.5])
@pytest.mark.parametrize("controller", ["points", "motion-ga"])
def test_a_velocity_that_ends_in_a_wall_is_refused_however_slow_it_is(controller: str, forward_m_s: float) -> None:
    """A planned motion's way is looked along in pieces; each is shorter than the slack where the rover is slow."""
    evidence, pose = open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    settings = Settings.model_validate({"guidance": {"controller": controller}})
    at = replace(view(evidence, pose), settings=settings)
    wall_m = MIDDLE + math.copysign(RADIUS_M + 0.7 * abs(forward_m_s), forward_m_s)
    told = GuidedVelocity(forward_m_s, 0.0)
    assert fault_of(told, at, Bounds()) is None
    row = round(wall_m / evidence.evidence_m)
    evidence.log_odds[row - 1 : row + 1] = 2.0
    found = fault_of(told, at, Bounds())
    assert found is not None and found.kind is SetpointFault.INTO_OBSTACLE


@pytest.mark.parametrize("beyond_m", [-0.05, 0.05])
def test_what_stands_before_the_edge_of_the_map_counts_for_a_target_beyond_it(beyond_m: float) -> None:
    evidence = open_ground()
    patched(evidence, MIDDLE + 3.0, MIDDLE - 0.5, 1.0, 2.0)
    there = GuidedPosition(NedPoint(SIDE + beyond_m, MIDDLE))
    assert fault(Output(there, Pose(MIDDLE, MIDDLE, 0.0, 0.0), 0.5), evidence) is SetpointFault.BEHIND_OBSTACLE


def test_a_refused_setpoint_becomes_velocity_zero_and_is_said_and_counted() -> None:
    notices = Notices()
    check, at = SetpointCheck(notices), view(open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0))
    good = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(MIDDLE + 5.0, MIDDLE)), 1.0)
    assert check.passed(good, at, Bounds()) == good and not notices.told and not check.refused
    far = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(MIDDLE + 50.0, MIDDLE)), 1.0)
    assert check.passed(far, at, Bounds()).setpoint == STOP
    assert notices.told == [("Stopping: target farther away than the horizon", Severity.WARNING)]
    assert check.refused.total() == 1


def test_a_rule_more_is_asked_like_the_others() -> None:
    check = SetpointCheck(Notices(), (lambda setpoint, at, bounds: Reason(SetpointFault.NOT_A_NUMBER),))
    drive = ControlCommand(Purpose.LOOK, GuidedHeading(0.0), 0.5)
    at = view(open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0))
    assert check.passed(drive, at, Bounds()).setpoint == STOP
    assert check.refused == {SetpointFault.NOT_A_NUMBER: 1}


def test_guidance_that_has_gone_mad_does_not_get_past_it(tmp_path: Path) -> None:
    """From some moment on the driver wants straight through the wall: the rover stops, and says why."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(2.0)
    driver = rig.companion.driver
    assert driver is not None
    through = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(0.0, 7.0)), 2.0)
    driver.guide = lambda *_: through  # type: ignore[method-assign]
    since_s = rig.now_s()
    rig.run_for(10.0)
    setpoints = [one for one in rig.sent_since(since_s) if one.is_setpoint]
    assert setpoints and all(one.is_standstill for one in setpoints[1:])
    assert rig.speed_m_s < 0.05 and rig.simulator.collisions == ()
    assert rig.companion.mission_run.setpoint_check.refused.total() > 100
    assert "Stopping: target behind something" in rig.texts()


# --- borders ---------------------------------------------------------------------------------------------------------


def inner(side_m: float) -> Bound:
    """A square in the middle of the ground that the rover must not leave."""
    corner = MIDDLE - side_m / 2.0
    square = shapely.box(corner, corner, corner + side_m, corner + side_m)
    return Bound("the yard", square, True, RADIUS_M, RADIUS_M)


@runs(max_examples=examples(400), deadline=None)
@given(st.one_of(POSITIONS, VELOCITIES), st.floats(5.0, 12.0))
def test_what_passes_keeps_the_rovers_middle_inside_its_borders(output: Output, side_m: float) -> None:
    bound = inner(side_m)
    if fault(output, open_ground(), bound):
        return
    here, setpoint = output.pose, output.setpoint
    if isinstance(setpoint, GuidedPosition):
        way = shapely.LineString([(here.east_m, here.north_m), (setpoint.point.east_m, setpoint.point.north_m)])
    else:
        assert isinstance(setpoint, GuidedVelocity)
        fastest_m_s = max(abs(setpoint.forward_m_s), output.speed_m_s)
        if setpoint.forward_m_s == 0.0:
            return
        course_rad = here.heading_rad + (math.pi if setpoint.forward_m_s < 0.0 else 0.0)
        curvature_per_m = setpoint.yaw_rate_rad_s / max(output.speed_m_s, SETTINGS.steering.scale_base_m_s)
        north_m, east_m, points = here.north_m, here.east_m, []
        for _ in np.arange(0.0, fastest_m_s * 0.25 + fastest_m_s**2 / 1.6, 0.02):
            points.append((east_m, north_m))
            north_m, east_m = north_m + 0.02 * math.cos(course_rad), east_m + 0.02 * math.sin(course_rad)
            course_rad += 0.02 * curvature_per_m
        way = shapely.LineString([(here.east_m, here.north_m), *points, (east_m, north_m)])
    assert bound.shape.buffer(0.02).covers(way)


@pytest.mark.parametrize(
    ("setpoint", "heading_rad", "refused"),
    [
        (GuidedPosition(NedPoint(MIDDLE + 2.0, MIDDLE)), 0.0, False),
        (GuidedPosition(NedPoint(MIDDLE + 3.5, MIDDLE)), 0.0, True),
        (GuidedVelocity(1.5, 0.0), 0.0, False),
        (GuidedVelocity(2.0, 0.0), 0.0, True),
        (GuidedVelocity(-2.0, 0.0), math.pi, True),
        (GuidedVelocity(-1.5, 0.0), math.pi, False),
        (GuidedVelocity(0.0, 0.0), 0.0, False),
        (GuidedHeading(0.0), 0.0, False),
    ],
)
def test_positions_and_velocities_before_a_border(setpoint: Setpoint, heading_rad: float, refused: bool) -> None:
    """3 m from the middle: from 2 m/s the rover needs 3 m, from 1.5 m/s 1.8 m, and its body is 0.35 m."""
    at = view(open_ground(), Pose(MIDDLE, MIDDLE, heading_rad, 0.0))
    found = inside_borders(setpoint, at, Bounds((inner(6.0),)))
    assert found == (Reason(SetpointFault.OVER_BORDER, ("the yard",)) if refused else None)


@pytest.mark.parametrize(
    ("north_m", "east_m", "yaw_rate_rad_s", "refused"),
    [
        (2.9, 9.0, 0.0, True),
        (2.75, 9.0, 0.8, False),
        (2.6, 9.0, 0.8, True),
        (9.0, 2.05, 0.8, False),
        (9.0, 1.85, 0.8, True),
        (9.0, 1.0, -0.8, False),
    ],
)
def test_a_turn_stops_on_the_arc_of_its_speed(
    north_m: float, east_m: float, yaw_rate_rad_s: float, refused: bool
) -> None:
    """From 2 m/s the rover comes 3 m far straight on; on the arc of 0.8 rad/s 2.33 m north and 1.6 m east."""
    yard_shape = shapely.box(-9.0, -9.0, MIDDLE + east_m, MIDDLE + north_m)
    bounds = Bounds((Bound("the yard", yard_shape, True, RADIUS_M, RADIUS_M),))
    at = view(open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0), 2.0)
    assert bool(inside_borders(GuidedVelocity(2.0, yaw_rate_rad_s), at, bounds)) is refused


@pytest.mark.parametrize(("forward_m_s", "refused"), [(0.0, False), (1.0, True), (-1.0, True)])
def test_close_before_a_border_only_standing_still_is_left(forward_m_s: float, refused: bool) -> None:
    """At 2 m/s with borders 0.5 m ahead and behind: to be told to stand is never wrong."""
    at = view(open_ground(), Pose(MIDDLE, MIDDLE, 0.0, 0.0), 2.0)
    assert bool(inside_borders(GuidedVelocity(forward_m_s, 0.0), at, Bounds((inner(1.0),)))) is refused


@pytest.mark.parametrize(
    ("east_m", "heading_rad", "yaw_rate_rad_s", "refused"),
    [
        (0.1, 0.0, 1.0, True),
        (0.1, 0.0, -1.0, False),
        (3.0, 0.0, 1.0, False),
        (0.5, 0.5 * math.pi, 0.5, False),
    ],
)
def test_a_stop_may_turn_over_a_border_only_where_a_plain_one_crosses_it_too(
    east_m: float, heading_rad: float, yaw_rate_rad_s: float, refused: bool
) -> None:
    """At 2 m/s, along a border so far to the right, and straight towards one."""
    yard_shape = shapely.box(-9.0, -9.0, MIDDLE + RADIUS_M + east_m, 99.0)
    bounds = Bounds((Bound("the yard", yard_shape, True, RADIUS_M, RADIUS_M),))
    at = replace(view(open_ground(), Pose(MIDDLE, MIDDLE, heading_rad, 0.0), 2.0), settings=PLANNED)
    assert bool(inside_borders(GuidedVelocity(0.0, yaw_rate_rad_s), at, bounds)) is refused
    assert inside_borders(GuidedVelocity(0.0, yaw_rate_rad_s), replace(at, speed_m_s=0.0), bounds) is None
    assert inside_borders(GuidedVelocity(0.0, yaw_rate_rad_s), replace(at, settings=SETTINGS), bounds) is None


@pytest.mark.parametrize("walled", [True, False])
def test_a_stop_may_turn_over_a_border_where_a_plain_one_ends_in_an_obstacle(walled: bool) -> None:
    """A wall 1 m ahead of a rover at 2 m/s, and a border beside it."""
    evidence = open_ground()
    if walled:
        north = int((MIDDLE + 1.0) / evidence.evidence_m)
        evidence.log_odds[north : north + 4, :] = 3.0
    bounds = Bounds(
        (Bound("the yard", shapely.box(-9.0, -9.0, MIDDLE + RADIUS_M + 0.1, 99.0), True, RADIUS_M, RADIUS_M),)
    )
    at = replace(view(evidence, Pose(MIDDLE, MIDDLE, 0.0, 0.0), 2.0), settings=PLANNED)
    assert bool(inside_borders(GuidedVelocity(0.0, 1.0), at, bounds)) is not walled


def test_guidance_that_would_leave_the_fence_does_not_get_past_it(tmp_path: Path) -> None:
    """Without the map and its rules the shapes alone keep the rover inside the autopilot's fence, and it is said."""
    rig = Rig(yard(tmp_path), prepare=stored(box(KEEP_IN, -6.0, -2.4, 6.5, 20.0), **POLYGONS, FENCE_MARGIN=0.0))
    rig.until_driven(1.0)
    driver, bounds = rig.companion.driver, rig.companion.executor.layout.bounds  # type: ignore[union-attr]
    assert driver is not None and len(bounds) == 1
    rig.companion.mission_run.setpoint_check = SetpointCheck(rig.companion._notifier, (inside_borders,))
    out = ControlCommand(Purpose.DRIVE, GuidedVelocity(1.5, 0.0), 1.5)
    driver.guide = lambda *_: out  # type: ignore[method-assign]
    rig.run_for(15.0)
    assert any("setpoint leads over the border of the autopilot's fence" in text for text in rig.texts())
    assert rig.simulator._vehicle.fence.count == 0 and rig.speed_m_s < 0.05
