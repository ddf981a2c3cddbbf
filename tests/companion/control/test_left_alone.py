"""What becomes of a rover that is left alone with a velocity, against a slow reading of the same map with shapes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import settings as runs
from hypothesis import strategies as st
from shapely import affinity

from companion.control.following import turn_gains
from companion.control.left_alone import Met, first_met, once_turned_back, ways_left_alone
from companion.control.local_view import LocalView
from companion.control.motion_controller import ALONE_STEP_S, _latest, _pending, _soonest, rover_model, worst_model
from companion.control.motion_kernels import moved
from companion.control.setpoint_check import fault_of
from companion.control.told import ToldVelocity
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_edits import forget_weak_evidence
from companion.mission.bounds import Bound, Bounds
from companion.safety.reasons import SetpointFault
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity
from tests.support.quick import examples

SIDE = 20
MIDDLE = 0.5 * SIDE
GUIDANCE = {"controller": "motion-ga", "velocity_lasts_s": 0.35}
SETTINGS = Settings.model_validate({"guidance": GUIDANCE, "mapping": {"evidence_m": 0.1}})
LONG = Footprint.rectangle(1.6, 0.5)
CELL_M = 0.1


def open_ground() -> EvidenceMap:
    evidence = new_map(empty_grid(SIDE, SIDE), 0.35, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    evidence.seen.add(0, 0, *reversed(evidence.log_odds.shape))
    assert evidence.evidence_m == pytest.approx(CELL_M)
    return evidence


def put(evidence: EvidenceMap, north_m: float, east_m: float, value: float = 3.0) -> None:
    """One cell, so far north and east of the rover's place in the middle."""
    y, x = (math.floor((MIDDLE + v) / CELL_M) for v in (north_m, east_m))
    evidence.log_odds[y, x] = value


def view(evidence: EvidenceMap, speed_m_s: float = 0.0, body: Footprint | None = LONG) -> LocalView:
    pose = Pose(MIDDLE, MIDDLE, 0.0, 0.0)
    return LocalView(pose, speed_m_s, evidence, RoverLimits(0.35, 2.0, 8.0), SETTINGS, body=body)


def fault(told: GuidedVelocity, at: LocalView, *bounds: Bound) -> SetpointFault | None:
    found = fault_of(told, at, Bounds(bounds))
    return None if found is None else found.kind


@pytest.mark.parametrize(
    ("north_m", "east_m", "refused"), [(0.95, 0.02, True), (0.95, 0.15, True), (0.55, 0.35, False), (1.25, 0.02, False)]
)
def test_the_whole_outline_counts_not_a_circle(north_m: float, east_m: float, refused: bool) -> None:
    """Its nose is 0.8 m ahead; told 0.5 m/s it goes on by 0.2 m. A circle round it would reach 0.84 m aside."""
    evidence = open_ground()
    put(evidence, north_m, east_m)
    wanted = SetpointFault.INTO_OBSTACLE if refused else None
    assert fault(GuidedVelocity(0.5, 0.0), view(evidence)) is wanted


def test_a_rover_that_ground_drags_may_shoot_ahead_where_it_ends() -> None:
    evidence = open_ground()
    put(evidence, 2.5, 0.02)
    told, held = GuidedVelocity(0.8, 0.0), view(evidence, 0.8)
    assert fault(told, held) is None
    assert fault(told, replace(held, dragged_m_s=1.5)) is SetpointFault.INTO_OBSTACLE


def test_a_long_rover_that_stands_may_not_turn_against_a_post_and_a_round_one_may() -> None:
    evidence = open_ground()
    put(evidence, 0.65, 0.35)
    turn = GuidedVelocity(0.0, 1.0)
    assert fault(turn, view(evidence)) is SetpointFault.INTO_OBSTACLE
    assert fault(turn, view(evidence, body=Footprint.circle(0.5))) is None
    assert fault(GuidedVelocity(0.0, -1.0), view(evidence)) is None


def test_braking_is_told_anywhere() -> None:
    evidence = open_ground()
    for north_m in np.arange(0.9, 3.0, 0.1):
        put(evidence, north_m, 0.0)
    for told in (GuidedVelocity(0.0, 0.0), GuidedVelocity(0.0, 0.8)):
        assert fault(told, view(evidence, 1.5)) is None
    assert fault(GuidedVelocity(0.1, 0.0), view(evidence, 1.5)) is SetpointFault.INTO_OBSTACLE


def test_a_rover_that_brakes_may_not_turn_into_something_meanwhile() -> None:
    evidence = open_ground()
    put(evidence, 0.65, 0.35)
    at = view(evidence, 0.06)
    assert fault(GuidedVelocity(0.0, 1.5), at) is SetpointFault.INTO_OBSTACLE
    assert fault(GuidedVelocity(0.0, 0.0), at) is fault(GuidedVelocity(0.0, -1.5), at) is None


def test_a_rover_that_is_told_to_go_back_may_not_turn_into_something_before_it_does() -> None:
    evidence = open_ground()
    for north_m in np.arange(-1.5, 3.5, 0.1):
        put(evidence, north_m, 0.6)
    at = view(evidence, 1.8)
    assert fault(GuidedVelocity(-0.3, 1.5), at) is SetpointFault.INTO_OBSTACLE
    assert fault(GuidedVelocity(-0.3, 0.0), at) is None


def test_an_obstacle_that_was_forgotten_counts_as_unseen_also_beside_the_rover() -> None:
    evidence = open_ground()
    put(evidence, -0.85, 0.02)
    put(evidence, 0.0, 0.5, 0.0)  # nobody ever saw this
    back = GuidedVelocity(-0.6, 0.0)
    assert fault(back, view(evidence)) is SetpointFault.INTO_OBSTACLE
    assert forget_weak_evidence(evidence, NedPoint(MIDDLE, MIDDLE), 2.5)
    assert fault(back, view(evidence)) is SetpointFault.ONTO_UNSEEN
    assert fault(GuidedVelocity(0.3, 0.4), view(evidence)) is None


def test_ground_that_was_not_seen_counts_but_not_where_no_sensor_sees_it() -> None:
    evidence = open_ground()
    evidence.log_odds[round((MIDDLE + 1.4) / CELL_M) :] = 0.0
    assert fault(GuidedVelocity(0.5, 0.0), view(evidence)) is None
    assert fault(GuidedVelocity(1.2, 0.0), view(evidence, 1.0)) is SetpointFault.ONTO_UNSEEN
    put(evidence, 0.0, 0.5, 0.0)
    assert fault(GuidedVelocity(0.3, 0.4), view(evidence)) is None


@pytest.mark.parametrize(("body", "most_m_s"), [(Footprint.circle(0.35), 0.5), (LONG, 0.35)])
def test_of_ground_that_nobody_ever_saw_only_what_lies_round_the_rover_is_driven_over(
    body: Footprint, most_m_s: float
) -> None:
    """Where planning went wrong, it may roll on at a crawl, and no faster."""
    evidence = open_ground()
    evidence.log_odds.fill(0.0)
    assert fault(GuidedVelocity(0.15, 0.0), view(evidence, 0.15, body)) is None
    fast = fault(GuidedVelocity(most_m_s, 0.0), view(evidence, most_m_s, body))
    assert fast is SetpointFault.ONTO_UNSEEN


def test_a_turn_that_comes_out_larger_than_told_is_counted_on() -> None:
    """At 1.5 m/s, 0.5 rad/s: the post lies beside the way as told, and on that of a rover that turns 1.3 times more."""
    at = view(open_ground(), 1.5)
    follows = (at.following._replace(off_model=off, turn_off_model=off) for off in (0.0, 0.3))
    as_told, more = (first_met_with(replace(at, following=one)) for one in follows)
    assert as_told is None and more is SetpointFault.INTO_OBSTACLE


def first_met_with(at: LocalView) -> SetpointFault | None:
    """With settings that let a velocity last 3 s."""
    guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": 3.0})
    put(at.evidence, 3.0, 2.9)
    return fault(GuidedVelocity(1.5, 0.5), replace(at, settings=SETTINGS.model_copy(update={"guidance": guidance})))


@pytest.mark.parametrize(("speed_m_s", "refused"), [(0.5, False), (2.0, True)])
def test_the_edge_of_the_map_is_ground_that_nobody_saw(speed_m_s: float, refused: bool) -> None:
    at = replace(view(open_ground(), speed_m_s), pose=Pose(SIDE - 3.0, MIDDLE, 0.0, 0.0))
    assert fault(GuidedVelocity(speed_m_s, 0.0), at) is (SetpointFault.ONTO_UNSEEN if refused else None)


def test_a_rover_over_something_gets_away_but_not_farther_over_it() -> None:
    evidence = open_ground()
    for east_m in np.arange(-0.3, 0.3, 0.1):
        put(evidence, 0.72, east_m)
    assert fault(GuidedVelocity(-0.4, 0.0), view(evidence)) is None
    assert fault(GuidedVelocity(0.4, 0.0), view(evidence)) is SetpointFault.INTO_OBSTACLE


def test_a_field_that_is_closed_may_be_left_and_not_entered() -> None:
    evidence = open_ground()
    evidence.base.weights[int(MIDDLE) + 1, :] = 1.0
    assert fault(GuidedVelocity(1.0, 0.0), view(evidence, 1.0)) is SetpointFault.INTO_OBSTACLE
    inside = replace(view(evidence), pose=Pose(MIDDLE + 1.5, MIDDLE, 0.0, 0.0))
    assert fault(GuidedVelocity(0.5, 0.0), inside) is None


@pytest.mark.parametrize(("beside_m", "refused"), [(0.03, False), (0.1, True)])
def test_the_corner_of_a_closed_field_may_be_cut(beside_m: float, refused: bool) -> None:
    """The rover's middle passes so deep inside its edge, for a metre."""
    evidence = open_ground()
    evidence.base.weights[int(MIDDLE) + 1, int(MIDDLE)] = 1.0
    at = replace(view(evidence, 1.0), pose=Pose(MIDDLE + 0.5, MIDDLE + 1.0 - beside_m, 0.0, 0.0))
    assert fault(GuidedVelocity(1.0, 0.0), at) is (SetpointFault.INTO_OBSTACLE if refused else None)


@pytest.mark.parametrize(("row", "told_m_s", "refused"), [(1, 0.3, False), (2, 2.0, True)])
def test_what_experience_closed_does_not_keep_a_rover_that_reaches_into_it(
    row: int, told_m_s: float, refused: bool
) -> None:
    """It reaches 0.84 m. The first row begins 0.1 m ahead, the second one beyond its reach."""
    evidence = open_ground()
    evidence.penalty[int(MIDDLE) + row, :] = 1.0
    at = replace(view(evidence, 0.8), pose=Pose(MIDDLE + 0.9, MIDDLE + 0.5, 0.0, 0.0))
    assert fault(GuidedVelocity(told_m_s, 0.0), at) is (SetpointFault.INTO_OBSTACLE if refused else None)


@pytest.mark.parametrize(("lasts_s", "refused"), [(0.35, False), (3.2, True)])
def test_borders_count_for_as_long_as_the_velocity_lasts(lasts_s: float, refused: bool) -> None:
    """1 m/s, 4 m before a border: without a guard the rover goes on for 3.2 s."""
    square = shapely.box(0.0, 0.0, SIDE, MIDDLE + 4.0)
    guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": lasts_s})
    at = replace(view(open_ground(), 1.0), settings=SETTINGS.model_copy(update={"guidance": guidance}))
    found = fault(GuidedVelocity(1.0, 0.0), at, Bound("the yard", square, True, 0.35, 0.35))
    assert found is (SetpointFault.OVER_BORDER if refused else None)


def test_a_rover_that_rolls_too_fast_to_go_back_soon_is_told_to_all_the_same() -> None:
    """It only brakes for as long as the velocity lasts. Beyond a border it would be no better off if it was refused."""
    square = Bound("the yard", shapely.box(0.0, 0.0, SIDE, MIDDLE + 1.0), True, 0.35, 0.35)
    at = view(open_ground(), 2.0)
    assert fault(GuidedVelocity(-0.4, 0.0), at) is None
    assert fault(GuidedVelocity(-0.4, 0.0), at, square) is SetpointFault.OVER_BORDER, "it stands beyond it"
    assert fault(GuidedVelocity(-0.4, 0.0), view(open_ground(), 0.3), square) is None


def test_what_was_told_before_has_its_effect_first_and_after_a_position_the_rover_drives_on() -> None:
    evidence = open_ground()
    for east_m in np.arange(-0.3, 0.3, 0.1):
        put(evidence, 1.05, east_m)
    slow = GuidedVelocity(0.1, 0.0)
    assert fault(slow, replace(view(evidence, 0.2), lately=(ToldVelocity(-1.0, 0.2, 0.0),))) is None
    for before in (
        replace(view(evidence, 0.2), lately=(ToldVelocity(-0.35, 2.0, 0.0),)),
        replace(view(evidence, 0.2), told=GuidedPosition(NedPoint(MIDDLE + 5.0, MIDDLE))),
    ):
        assert fault(slow, before) is SetpointFault.INTO_OBSTACLE


def test_without_a_guard_a_turn_that_is_under_way_may_end_soon() -> None:
    """Three seconds later that is decimetres aside: a post stands where a rover that obeys late does not come."""
    evidence = open_ground()
    guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": 3.0})
    strict = SETTINGS.model_copy(update={"guidance": guidance})
    turning = tuple(ToldVelocity(-0.05 * ago, 1.0, 1.0) for ago in range(20, 0, -1))
    at = replace(view(evidence, 1.0, Footprint.circle(0.2)), settings=strict, lately=turning, yaw_rate_rad_s=1.0)
    straight = GuidedVelocity(1.0, 0.0)
    put(evidence, 3.6, 0.25)  # nobody comes there
    assert fault(straight, at) is None
    put(evidence, 3.6, 0.85)
    assert fault(straight, at) is SetpointFault.INTO_OBSTACLE


@st.composite
def grounds(draw) -> EvidenceMap:
    """Some cells that stand, and patches that nobody has seen."""
    evidence, place = open_ground(), st.floats(-4.0, 4.0)
    for _ in range(draw(st.integers(0, 12))):
        put(evidence, draw(place), draw(place))
    for _ in range(draw(st.integers(0, 3))):
        y, x = (round((MIDDLE + draw(place)) / CELL_M) for _ in range(2))
        evidence.log_odds[y : y + draw(st.integers(1, 12)), x : x + 6] = 0.0
    return evidence


BODIES = st.sampled_from((LONG, Footprint.rectangle(0.9, 0.7, 0.2), Footprint.circle(0.4)))


@runs(max_examples=examples(150), deadline=None)
@given(grounds(), BODIES, st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(0.0, 2.0))
def test_what_passes_is_free_under_the_outline_in_shapes(
    evidence: EvidenceMap, body: Footprint, forward_m_s: float, turn_rad_s: float, speed_m_s: float
) -> None:
    at = view(evidence, speed_m_s, body)
    told = GuidedVelocity(forward_m_s, turn_rad_s)
    standing = shapely.points((np.argwhere(evidence.log_odds >= 1.0)[:, ::-1] + 0.5) * CELL_M)
    if shape(body, MIDDLE, MIDDLE, 0.0).buffer(0.01).intersects(shapely.multipoints(standing)):
        return
    if forward_m_s == 0.0 or fault(told, at) is not None:
        return
    ways = ways_left_alone(told, at)
    assert ways is not None and len(ways) == len(turn_gains(at.following, at.settings.guidance.velocity_lasts_s))
    stops = ways_left_alone(GuidedVelocity(0.0, 0.0), at)
    assert stops is not None
    if speed_m_s * forward_m_s < 0.0 and any(first_met(way, at) is not Met.NOTHING for way in stops):
        ways = [once_turned_back(way, told, at) for way in ways]
    unseen = shapely.points((np.argwhere(evidence.log_odds == 0.0)[:, ::-1] + 0.5) * CELL_M)
    around_m = max(body.radius_m, 1.5 * body.half_width_m) + 0.12
    far = unseen[shapely.distance(unseen, shapely.Point(MIDDLE, MIDDLE)) > around_m]
    for way in ways:
        assert first_met(way, at) is Met.NOTHING
        if shapely.intersects(shape(body, *way[0, :3]).buffer(-0.05), standing).any():
            continue  # told to go back it brakes up to here, as it does whatever it is told
        for north_m, east_m, heading_rad, _ in way:
            outline = shape(body, north_m, east_m, heading_rad)
            assert not shapely.intersects(outline.buffer(-0.055), standing).any()
            assert not shapely.intersects(outline.buffer(-0.105), far).any()


def shape(body: Footprint, north_m: float, east_m: float, heading_rad: float) -> shapely.Polygon:
    """The outline at a place: x east, y north."""
    if body.is_circle:
        return shapely.Point(east_m, north_m).buffer(body.front_m)
    still = shapely.box(-body.half_width_m, -body.rear_m, body.half_width_m, body.front_m)
    return affinity.translate(affinity.rotate(still, -math.degrees(heading_rad), origin=(0, 0)), east_m, north_m)


@pytest.mark.parametrize("lasts_s", [0.35, 3.2])
def test_its_way_is_as_long_as_physics_makes_it(lasts_s: float) -> None:
    """At 1 m/s: dead time and what the command lasts, and then braking by 30 % worse than it should."""
    guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": lasts_s})
    at = replace(view(open_ground(), 1.0), settings=SETTINGS.model_copy(update={"guidance": guidance}))
    ways = ways_left_alone(GuidedVelocity(1.0, 0.0), at)
    assert ways is not None
    follows = at.following
    wanted_m = 1.3 * follows.dead_s + lasts_s + 0.5 / (0.7 * follows.deceleration_m_s2)
    assert ways[0][-1, 0] - MIDDLE == pytest.approx(wanted_m, abs=0.06)


@runs(max_examples=examples(200), deadline=None)
@given(
    st.lists(st.tuples(st.floats(-1.0, 2.0), st.floats(-1.5, 1.5)), max_size=10),
    st.tuples(st.floats(-1.0, 2.0), st.floats(-1.5, 1.5)),
    st.floats(0.0, 1.5),
    st.floats(-1.5, 1.5),
    st.sampled_from([0.1, 0.2, 0.33, 0.5]),
    st.sampled_from([None, math.inf, 3.0, 0.6]),
)
def test_it_leads_where_the_planning_thinks_though_reckoned_apart(
    lately: list[tuple[float, float]],
    told: tuple[float, float],
    speed_m_s: float,
    turn_rad_s: float,
    dead_s: float,
    placed_m_s: float | None,
) -> None:
    """A last look that went another way would refuse what was planned well."""
    moment = replace(
        view(open_ground(), speed_m_s),
        yaw_rate_rad_s=turn_rad_s,
        lately=tuple(ToldVelocity(-0.05 * (len(lately) - i), *one) for i, one in enumerate(lately)),
        placed_s=-math.inf if placed_m_s is None else -0.05 * (len(lately) + 1),
        placed_m_s=placed_m_s or math.inf,
        settings=Settings.model_validate({"guidance": {"controller": "motion-ga"}}),
    )
    moment = replace(moment, following=moment.following._replace(dead_s=dead_s))
    model = worst_model(rover_model(moment), moment.following)
    ways = ways_left_alone(GuidedVelocity(*told), moment)
    assert ways is not None
    gains = turn_gains(moment.following, moment.settings.guidance.velocity_lasts_s)
    each = [(_pending(moment, steps(moment), ALONE_STEP_S), gain) for steps in (_latest, _soonest) for gain in gains]
    for way, (pending, gain) in zip(ways, each, strict=True):
        state, planned = (MIDDLE, MIDDLE, 0.0, speed_m_s, turn_rad_s), []
        for told_m_s, told_rad_s in [*pending, *[told] * 60, *[(0.0, 0.0)] * 200]:
            state = moved(state, told_m_s, gain * told_rad_s, model, ALONE_STEP_S)
            planned.append((state[1], state[0]))
        assert np.hypot(*(way[-1, :2] - planned[-1])) < 0.07


def test_a_rover_over_something_may_leave_it_but_not_touch_the_next_thing_as_deep() -> None:
    for ahead_m, met in ((None, Met.NOTHING), (1.2, Met.OBSTACLE)):
        evidence = open_ground()
        put(evidence, 0.0, 0.35)  # 0.1 m inside its right side
        if ahead_m is not None:
            put(evidence, ahead_m, 0.35)
        guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": 3.0})
        at = view(evidence, 0.0, Footprint.rectangle(0.4, 0.9))
        at = replace(at, settings=SETTINGS.model_copy(update={"guidance": guidance}))
        ways = ways_left_alone(GuidedVelocity(0.4, 0.0), at)
        assert ways is not None and {first_met(way, at) for way in ways} == {met}


def test_without_a_guard_the_rover_may_turn_still_more_and_less_than_told() -> None:
    for lasts_s, off in ((0.3, 0.3), (3.0, 0.4)):
        guidance = SETTINGS.guidance.model_copy(update={"velocity_lasts_s": lasts_s})
        at = replace(view(open_ground(), 0.5), settings=SETTINGS.model_copy(update={"guidance": guidance}))
        ways = ways_left_alone(GuidedVelocity(0.5, 0.5), at)
        assert ways is not None
        least_rad, told_rad, most_rad = sorted(float(way[-1, 2]) for way in ways[:3])  # it obeys late
        assert most_rad / told_rad == pytest.approx(1.0 + off, abs=0.05)
        assert least_rad / told_rad == pytest.approx(1.0 - off, abs=0.05)


def test_on_a_slower_leg_planning_and_last_look_count_on_the_speed_that_was_told_before() -> None:
    """The planning sees the leg's speed, the last look the mission's; the rover still goes to a place at 2 m/s."""
    seen = replace(view(open_ground(), 1.0), placed_s=-0.1, placed_m_s=2.0)
    seen = replace(seen, rover=replace(seen.rover, cruise_speed_m_s=3.0))
    leg = seen.with_speeds(1.0, 3.0)
    assert set(_pending(leg, _latest(leg), ALONE_STEP_S)[:, 0]) == {2.0}
    ways = [ways_left_alone(GuidedVelocity(0.5, 0.0), one) for one in (seen, leg)]
    assert ways[0] is not None and ways[1] is not None
    assert all((one == other).all() for one, other in zip(*ways, strict=True))
    creeps = replace(seen, placed_m_s=0.6)
    assert set(_pending(creeps, _latest(creeps), ALONE_STEP_S)[:, 0]) == {0.6}, "told to drive there slowly"


def test_just_after_a_position_the_rover_still_drives_on() -> None:
    """The velocity told since has not had its effect yet."""
    evidence = open_ground()
    for east_m in np.arange(-0.3, 0.3, 0.1):
        put(evidence, 1.05, east_m)
    slow, first = GuidedVelocity(0.1, 0.0), (ToldVelocity(-0.05, 0.1, 0.0),)
    assert fault(slow, replace(view(evidence, 0.2), lately=first)) is None
    after = replace(view(evidence, 0.2), lately=first, placed_s=-0.1)
    assert fault(slow, after) is SetpointFault.INTO_OBSTACLE
    assert fault(slow, replace(after, placed_m_s=0.2)) is None, "on a leg that is driven slowly"
