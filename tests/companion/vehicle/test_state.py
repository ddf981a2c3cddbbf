"""The state that events add up to."""

import math

import numpy as np
import pytest

from companion.core.arrival_jitter import ArrivalJitter
from companion.core.frames import GeoPoint
from companion.core.scan import WIRED, RangeScan
from companion.mission.autopilot_fence import PARAMETERS
from companion.vehicle.events import (
    AckSeen,
    AttitudeSeen,
    EkfStatusSeen,
    Event,
    GlobalPositionSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterSeen,
    PrearmSeen,
    RangeSeen,
    TargetSeen,
    TextSeen,
    ThrottleSeen,
)
from companion.vehicle.link_latency import Latency
from companion.vehicle.state import PARAMETERS_KEPT, EkfQuantity, VehicleState, fold

PLACE = GeoPoint(-35.0, 149.0)
SCAN = RangeScan(1.0, np.full(1, np.pi), np.ones(1), 0.2, 8.0, 0.1, "behind")


@pytest.mark.parametrize(
    ("event", "name"),
    [
        (HeartbeatSeen(1.0, 15, True, 1), "heartbeat"),
        (LocalPositionSeen(1.0, 1.0, 2.0, 3.0, 0.0, 0.0), "position"),
        (AttitudeSeen(1.0, 1.0, 0.5, 0.1), "attitude"),
        (GlobalPositionSeen(1.0, 1.0, PLACE), "global_position"),
        (ThrottleSeen(1.0, 0.4), "throttle"),
        (EkfStatusSeen(1.0, 831), "ekf"),
        (OriginSeen(1.0, PLACE), "origin"),
        (HomeSeen(1.0, PLACE), "home"),
        (RangeSeen(1.0, SCAN), "scan"),
        (TargetSeen(1.0, PLACE, 3580), "target"),
        (PrearmSeen(1.0, True), "prearm"),
    ],
)
def test_the_newest_is_kept(event: Event, name: str) -> None:
    state = fold(VehicleState(), event)
    assert getattr(state, name) is event
    made = (
        "parameters",
        "jump_m",
        "others",
        "frozen",
        "reckoned",
        "restarted",
        "latency",
        "jitter",
        "sticks",
        "in_auto",
        "wander",
    )
    others = {field for field in VehicleState.__dataclass_fields__ if field not in (name, *made)}
    assert all(getattr(state, other) is None for other in others)


@pytest.mark.parametrize(
    ("bearing_deg", "range_m", "counts"),
    [(0.0, 3.0, True), (-15.0, np.inf, True), (355.0, 3.0, True), (45.0, 3.0, False), (0.0, np.nan, False)],
)
def test_range_data_ahead_is_told_from_the_rest(bearing_deg: float, range_m: float, counts: bool) -> None:
    scan = RangeScan(1.0, np.radians([bearing_deg]), np.array([range_m]), 0.2, 8.0, 0.1, "test")
    state = fold(VehicleState(), RangeSeen(1.0, scan))
    assert (state.scan_ahead is not None) == counts


def test_a_single_beam_ahead_does_not_take_the_place_of_a_lidar() -> None:
    """Which of them came last would decide how the rover is driven."""
    wide = RangeScan(1.0, np.radians(np.arange(-45.0, 45.0, 5.0)), np.full(18, 3.0), 0.2, 8.0, 0.1, "lidar")
    beam = RangeScan(1.05, np.array([0.0]), np.array([3.0]), 0.2, 8.0, 0.1, "beam")
    assert beam.is_narrow and not wide.is_narrow
    both = fold(fold(VehicleState(), RangeSeen(1.0, wide)), RangeSeen(1.05, beam))
    assert both.scan_ahead is not None and both.scan_ahead.scan is wide
    later = fold(both, RangeSeen(3.0, beam))
    assert later.scan_ahead is not None and later.scan_ahead.scan is beam
    assert fold(later, RangeSeen(3.1, wide)).scan_ahead == RangeSeen(3.1, wide)


@pytest.mark.parametrize("event", [AckSeen(1.0, 176, 0), TextSeen(1.0, 6, "hello")])
def test_answers_and_texts_are_no_state(event: Event) -> None:
    state = VehicleState()
    assert fold(state, event) is state


def test_parameters_are_collected_and_the_old_state_is_not_touched() -> None:
    first = fold(VehicleState(), ParameterSeen(1.0, "FENCE_RADIUS", 20.0))
    second = fold(fold(first, ParameterSeen(2.0, "WP_RADIUS", 1.0)), ParameterSeen(3.0, "FENCE_RADIUS", 30.0))
    assert first.parameters == {"FENCE_RADIUS": 20.0}
    assert second.parameters == {"FENCE_RADIUS": 30.0, "WP_RADIUS": 1.0}


def test_of_a_flood_of_parameters_only_those_of_use_are_kept() -> None:
    assert set(PARAMETERS) <= PARAMETERS_KEPT
    state = VehicleState()
    for n in range(1000):
        state = fold(state, ParameterSeen(1.0, f"FENCE_{n}", 1.0))
    assert state == VehicleState()
    known = fold(state, ParameterSeen(1.0, "WP_RADIUS", 1.0))
    assert fold(known, ParameterSeen(2.0, "WP_RADIUS", 1.0)) is known, "nothing is copied for what is known"


def moving() -> VehicleState:
    state = fold(VehicleState(), LocalPositionSeen(10.0, 5.0, 100.0, 50.0, 2.0, -1.0))
    return fold(state, AttitudeSeen(10.1, 5.1, 1.0, 0.5))


def test_pose_is_carried_forward() -> None:
    pose = moving().pose_at(10.2)
    assert pose is not None
    assert (pose.north_m, pose.east_m) == (pytest.approx(100.4), pytest.approx(49.8))
    assert pose.heading_rad == pytest.approx(1.05)
    assert pose.time_s == 10.2


def test_pose_is_carried_neither_far_nor_back_by_more_than_jitter() -> None:
    late, early, before = (moving().pose_at(time_s) for time_s in (60.0, 9.0, 9.8))
    assert late is not None and early is not None and before is not None
    assert (late.north_m, late.east_m, late.heading_rad) == (101.0, 49.5, 1.25)
    assert (early.north_m, early.east_m, early.heading_rad) == (99.5, 50.25, 0.875)
    assert (before.north_m, before.east_m) == (pytest.approx(99.6), pytest.approx(50.2))


def test_reports_that_wait_on_their_way_do_not_move_the_pose() -> None:
    """Reports every 0.05 s, taken in by ticks of a computer that is now and then late by up to 0.1 s."""
    rng = np.random.default_rng(0)
    state, off_m = VehicleState(), []
    for number in range(200):
        boot_s = 0.05 * number
        time_s = 30.0 + boot_s + (0.0 if number % 3 else float(rng.uniform(0.0, 0.1)))
        state = fold(state, LocalPositionSeen(time_s, boot_s, 2.0 * boot_s, 0.0, 2.0, 0.0))
        state = fold(state, AttitudeSeen(time_s, boot_s, 0.5 * boot_s, 0.5))
        pose = state.pose_at(time_s)
        assert pose is not None
        if number > 60:  # two windows, and the one that it began in
            off_m.append(pose.north_m - 2.0 * (time_s - 30.0))
            assert pose.heading_rad == pytest.approx(0.5 * (time_s - 30.0), abs=0.005)
    assert np.ptp(off_m) < 0.015, "0.2 m, were each taken for new when it comes"


def seen_at(time_s: float, late_s: float | None, sender: int = 1) -> RangeSeen:
    nothing = np.zeros(0)
    return RangeSeen(time_s, RangeScan(time_s, nothing, nothing, 0.1, 8.0, 0.1, "test", sender, late_s=late_s))


@pytest.mark.parametrize(("held_s", "off_m"), [(0.2, 0.02), (0.45, 0.02), (0.9, 0.02)])
def test_a_scan_lies_where_it_was_taken_when_it_was_held_up_together_with_positions(
    held_s: float, off_m: float
) -> None:
    """At 2 m/s all of a second is held up for a while. Its sensor tells no time, or one that is known to be as late."""
    state, jitter, off = VehicleState(), ArrivalJitter(), []
    for number in range(200):
        made_s = 0.05 * number
        time_s = 30.0 + max(made_s, 8.0 + held_s if 8.0 < made_s < 8.0 + held_s else 0.0)
        state = fold(state, LocalPositionSeen(time_s, made_s, 2.0 * made_s, 0.0, 2.0, 0.0))
        state = fold(state, AttitudeSeen(time_s, made_s, 0.0, 0.0))
        jitter = jitter.after(time_s, 700.0 + made_s)
        for late_s in (None, jitter.late_s(time_s, 700.0 + made_s)):
            pose = state.pose_at(state.seen_s(seen_at(time_s, late_s)))
            assert pose is not None
            off.append(abs(pose.north_m - 2.0 * made_s))
    assert max(off) < off_m, "in either case; new beside positions that have waited it was 0.5 m too far"


def test_a_wired_lidar_is_not_put_too_far_when_the_link_is_later_from_now_on() -> None:
    """By 0.2 s, before the next answer shows it: late positions count once, not as jitter and as latency."""
    state, off_m = VehicleState(latency=Latency((0.04, 0.04, 0.04))), []
    for number in range(240):
        made_s = 0.05 * number
        time_s = 30.0 + made_s + 0.02 + (0.2 if made_s > 8.0 else 0.0)
        state = fold(state, LocalPositionSeen(time_s, made_s, 1.5 * made_s, 0.0, 1.5, 0.0))
        state = fold(state, AttitudeSeen(time_s, made_s, 0.0, 0.0))
        pose = state.pose_at(state.seen_s(seen_at(time_s, None, WIRED)))
        assert pose is not None
        off_m.append(pose.north_m - 1.5 * (time_s - 30.0))
    assert max(off_m) < 0.01 and max(map(abs, off_m[:160])) < 0.01
    assert min(off_m[:175]) > -0.05, "for a second, in which it is jitter"
    assert off_m[-1] == pytest.approx(-0.18, abs=0.02), "half of what the next round trip will show"


def test_no_pose_without_both_position_and_attitude() -> None:
    assert VehicleState().pose_at(0.0) is None
    assert fold(VehicleState(), LocalPositionSeen(1.0, 1.0, 0.0, 0.0, 0.0, 0.0)).pose_at(1.0) is None
    assert fold(VehicleState(), AttitudeSeen(1.0, 1.0, 0.0, 0.0)).pose_at(1.0) is None


def test_speed_over_ground() -> None:
    assert VehicleState().speed_m_s == 0.0
    assert moving().speed_m_s == pytest.approx(math.sqrt(5.0))


@pytest.mark.parametrize(
    ("flags", "lacks"),
    [
        (None, EkfQuantity.POSITION),
        (0, EkfQuantity.POSITION),
        (1024, EkfQuantity.POSITION),
        (831, None),
        (1 | 2 | 8, None),
        (1 | 2 | 16, None),
        (831 & ~(8 | 16), EkfQuantity.POSITION),
        (831 | 128, EkfQuantity.POSITION),
        (167, EkfQuantity.POSITION),
        (831 & ~1, EkfQuantity.ATTITUDE),
        (831 & ~2, EkfQuantity.VELOCITY),
        (831 | 32768, None),
    ],
)
def test_ekf_flags(flags: int | None, lacks: EkfQuantity | None) -> None:
    state = VehicleState() if flags is None else fold(VehicleState(), EkfStatusSeen(1.0, flags))
    assert state.ekf_lacks is lacks


def test_driving_is_no_jump_but_a_reset_is() -> None:
    state = VehicleState()
    for i in range(20):
        state = fold(state, LocalPositionSeen(0.1 * i, 0.1 * i, 0.3 * i, 0.0, 3.0, 0.0))
        assert state.jump_m == pytest.approx(0.0, abs=1e-9)
    state = fold(state, LocalPositionSeen(2.0, 2.0, 6.0 + 3.0, 4.0, 3.0, 0.0))
    assert state.jump_m == pytest.approx(5.0)
    state = fold(state, LocalPositionSeen(2.1, 2.1, 9.3, 4.0, 3.0, 0.0))
    assert state.jump_m == pytest.approx(0.0, abs=1e-9)


def driven(speed_m_s: float, shown: float, seconds: float) -> VehicleState:
    """Straight north at 10 Hz; ``shown`` is the share of the way that the position follows."""
    state = fold(VehicleState(), HeartbeatSeen(0.0, 15, True, 1))
    for i in range(round(seconds * 10)):
        t_s = i / 10
        state = fold(state, LocalPositionSeen(t_s, t_s, shown * speed_m_s * t_s, 0.0, speed_m_s, 0.0))
    return state


@pytest.mark.parametrize("speed_m_s", [0.5, 2.0, 5.0])
def test_a_position_that_stands_still_while_the_velocity_goes_on_is_noticed(speed_m_s: float) -> None:
    """After 1.5 m, which is 0.75 s at 2 m/s."""
    seconds = 1.5 / speed_m_s + 0.3
    assert driven(speed_m_s, 0.0, seconds).frozen
    assert not driven(speed_m_s, 0.0, seconds / 2).frozen
    assert not driven(speed_m_s, 0.6, 10.0).frozen


def test_a_frozen_position_is_believed_again_when_a_person_sets_guided() -> None:
    state = driven(2.0, 0.0, 2.0)
    held = fold(state, HeartbeatSeen(2.0, 4, True, 1))
    assert held.frozen
    assert not fold(held, HeartbeatSeen(3.0, 15, True, 1)).frozen


def test_driving_in_circles_is_not_a_frozen_position() -> None:
    """A circle of 1 m at 1 m/s comes back to where it began again and again."""
    state = VehicleState()
    for i in range(300):
        t_s = i / 10
        place = (math.sin(t_s), 1.0 - math.cos(t_s), math.cos(t_s), math.sin(t_s))
        state = fold(state, LocalPositionSeen(t_s, t_s, *place))
        assert not state.frozen
