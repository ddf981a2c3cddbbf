"""Faults on purpose, in lock-step over MAVLink bytes: the rover stops, the pilot wins, and people are told why."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.navigation.field_step import Action
from companion.safety.reasons import Doubt, EndReason, LatchReason, RunPhase, WaitReason
from companion.settings import Settings, parse_settings
from tests.support.quick import first_of
from tests.support.rig import ARM, AUTO, GUIDED, HOLD, MANUAL, REBOOT, RTL, SET_MODE, Rig, Sent, without, yard

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
TICK_S = 0.05
REACHED, UNREACHABLE, SKIPPED = TargetStatus.REACHED, TargetStatus.UNREACHABLE, TargetStatus.SKIPPED


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A rover that has driven off, at full speed, with a wall ahead."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(2.0)
    return rig


def assert_reached(rig: Rig) -> None:
    rig.finish()
    assert rig.companion.outcome.complete
    assert rig.simulator.collisions == ()
    assert_setpoints_only_when_ours(rig.sent)


def assert_setpoints_only_when_ours(sent: list[Sent]) -> None:
    setpoints = [one for one in sent if one.is_setpoint]
    assert setpoints
    assert all(one.mode == GUIDED and one.armed for one in setpoints)


def assert_silent(rig: Rig, since_s: float) -> None:
    """Nothing that moves or changes the rover, but still there."""
    after = rig.sent_since(since_s)
    assert [one for one in after if one.moves_or_changes] == []
    beats = sum(one.kind == "HEARTBEAT" for one in after)
    assert beats >= math.floor(rig.now_s() - since_s) - 1


# --- the pilot wins -------------------------------------------------------------------------------------------------


@first_of(1,
    ("mode", "metres"),
    [
        pytest.param(mode, metres, marks=() if always else pytest.mark.thorough, id=f"{mode}-{metres}")
        for mode, metres, always in (
            (MANUAL, 0.05, True), (HOLD, 0.05, False), (RTL, 0.05, False),
            (MANUAL, 3.0, True), (HOLD, 3.0, True), (RTL, 3.0, False),
            (MANUAL, 10.5, False), (HOLD, 10.5, False), (RTL, 10.5, True),
        )
    ],
)  # fmt: skip
def test_a_mode_change_silences_the_companion_until_guided_returns(tmp_path: Path, mode: int, metres: float) -> None:
    rig = Rig(yard(tmp_path))
    rig.until_driven(metres)
    rig.pilot_mode(mode)
    rig.until(lambda: rig.mode == mode, 1.5)
    since_s = rig.now_s()
    # RTL drives straight home and knows nothing of walls.
    rig.run_for(4.0 if mode == RTL else 8.0)
    assert_silent(rig, since_s)
    assert rig.mode == mode
    assert rig.gave(LatchReason.OTHER_MODE)
    rig.pilot_mode(GUIDED)
    assert_reached(rig)


def test_a_person_who_takes_the_rover_before_it_is_armed_is_not_overruled(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), arm=False)
    rig.until(lambda: rig.mode == GUIDED)
    rig.run_for(2.0)
    rig.pilot_mode(HOLD)
    rig.until(lambda: rig.mode == HOLD, 1.5)
    since_s = rig.now_s()
    rig.run_for(10.0)
    assert_silent(rig, since_s)
    assert rig.awaits(WaitReason.PERSON_SETS_GUIDED_AGAIN)
    rig.pilot_mode(GUIDED)
    rig.pilot(ARM, 1)
    assert_reached(rig)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(1, 6))])
def test_setpoints_go_out_only_while_guided_and_armed(tmp_path: Path, seed: int) -> None:
    """A restless person: any mode at any time, arming and disarming; in the end the rover is given back."""
    rig, rng = Rig(yard(tmp_path), seed=seed), np.random.default_rng(seed)
    if seed % 2:
        rig.until_driven(1.0)
    for _ in range(25):
        match rng.integers(4):
            case 0:
                rig.pilot(ARM, 0)
            case 1:
                rig.pilot(ARM, 1)
            case _:
                rig.pilot_mode(int(rng.choice([MANUAL, HOLD, AUTO, RTL, GUIDED, GUIDED, GUIDED])))
        rig.run_for(float(rng.uniform(0.1, 4.0)))
    if not rig.companion.done:
        rig.run_for(45.0)
        rig.pilot_mode(GUIDED)
        rig.pilot(ARM, 1)
    rig.finish()
    assert_setpoints_only_when_ours(rig.sent)
    assert rig.companion.outcome.complete
    driving = [one for one in rig.sent if one.command in (SET_MODE, ARM)]
    # Its own start-up, its HOLD at the end: never a mode or an arming after it has once been given the rover.
    begun_s = next(one.time_s for one in rig.sent if one.is_setpoint)
    after = [one for one in driving if one.time_s > begun_s]
    assert {(one.command, one.message.param2) for one in after} <= {(SET_MODE, float(HOLD))}


def test_disarming_silences_it_and_it_never_arms_again(rig: Rig) -> None:
    rig.pilot(ARM, 0)
    rig.until(lambda: not rig.armed, 1.5)
    since_s = rig.now_s()
    rig.run_for(10.0)
    assert_silent(rig, since_s)
    assert rig.gave(LatchReason.DISARMED) and rig.awaits(WaitReason.PERSON_ARMS_AGAIN)
    rig.pilot(ARM, 1)
    assert_reached(rig)


# --- the state at connection ----------------------------------------------------------------------------------------


def test_armed_in_guided_at_connection_it_drives_without_being_told_to_arm(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), arm=False, late_s=50.0)
    rig.pilot_mode(GUIDED)
    rig.pilot(ARM, 1)
    assert_reached(rig)
    assert all(one.command != ARM for one in rig.sent)
    assert rig.now_s() < 50.0 + 30.0


def test_disarmed_without_arm_it_waits_for_a_person(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), arm=False, late_s=50.0)
    rig.run_for(30.0)
    assert all(one.command != ARM and not one.is_setpoint for one in rig.sent)
    assert rig.awaits(WaitReason.PERSON_ARMS)
    rig.pilot(ARM, 1)
    assert_reached(rig)


def test_armed_in_manual_at_connection_it_waits_for_a_person(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=50.0)
    rig.pilot(ARM, 1)
    rig.simulator.advance_to_s(50.5)
    rig.until(lambda: rig.armed, 2.0)
    rig.run_for(20.0)
    assert not [one for one in rig.sent if one.moves_or_changes]
    assert rig.awaits(WaitReason.PERSON_SETS_GUIDED)
    rig.pilot_mode(GUIDED)
    assert_reached(rig)


@pytest.mark.parametrize("arm", [False, True])
@first_of(1, "ends", ["HOLD", "disarmed"])
def test_a_person_who_drives_and_stops_before_the_first_metre_keeps_the_rover(
    tmp_path: Path, ends: str, arm: bool
) -> None:
    rig = Rig(yard(tmp_path), late_s=50.0, arm=arm)
    rig.pilot(ARM, 1)
    rig.until(lambda: rig.awaits(WaitReason.PERSON_SETS_GUIDED), 3.0)
    since_s = rig.now_s()
    if ends == "HOLD":
        rig.pilot_mode(HOLD)
    else:
        rig.pilot(ARM, 0)
        rig.run_for(5.0)
        rig.pilot(ARM, 1)
    rig.run_for(10.0)
    assert not [one for one in rig.sent_since(since_s) if one.moves_or_changes]
    assert rig.awaits_guided
    rig.pilot_mode(GUIDED)
    assert_reached(rig)


def test_a_person_who_takes_it_out_of_guided_before_the_first_metre_keeps_the_rover(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=50.0, arm=False)
    rig.change = without("LOCAL_POSITION_NED")
    rig.pilot_mode(GUIDED)
    rig.pilot(ARM, 1)
    rig.until(lambda: rig.mode == GUIDED and rig.armed, 3.0)
    rig.pilot_mode(HOLD)
    rig.until(lambda: rig.mode == HOLD, 3.0)
    rig.change, since_s = None, rig.now_s()
    rig.run_for(10.0)
    assert not [one for one in rig.sent_since(since_s) if one.moves_or_changes]
    rig.pilot_mode(GUIDED)
    assert_reached(rig)


# --- data that goes silent or bad -----------------------------------------------------------------------------------


def ekf_flags(clear: int = 0, set_too: int = 0) -> Callable[[Any], Any]:
    """EKF_STATUS_REPORT with some flags changed."""

    def changed(message: Any) -> Any:
        if message.get_type() == "EKF_STATUS_REPORT":
            message.flags = message.flags & ~clear | set_too
        return message

    return changed


OLD, INCOMPLETE = Doubt.DATA_OLD, Doubt.EKF_INCOMPLETE
FAULTS: dict[str, tuple[Callable[[Any], Any], Doubt, str]] = {
    "range data": (without("OBSTACLE_DISTANCE", "DISTANCE_SENSOR", "RANGEFINDER"), OLD, "range data ahead"),
    "position": (without("LOCAL_POSITION_NED"), OLD, "position"),
    "attitude": (without("ATTITUDE"), OLD, "attitude"),
    "EKF status": (without("EKF_STATUS_REPORT"), OLD, "EKF status"),
    "EKF has no position": (ekf_flags(clear=8 | 16, set_too=128), INCOMPLETE, "position"),
    "EKF has no attitude": (ekf_flags(clear=1), INCOMPLETE, "attitude"),
    "EKF has no velocity": (ekf_flags(clear=2), INCOMPLETE, "velocity"),
}


def test_the_flag_of_a_gps_glitch_alone_does_not_stop_it_as_it_does_not_stop_ardurover(rig: Rig) -> None:
    rig.change = ekf_flags(set_too=32768)
    rig.finish()
    assert rig.companion.outcome.complete and not rig.was_stopped


@first_of(2, "name", FAULTS)
def test_lost_data_stops_the_rover_and_then_holds(rig: Rig, name: str) -> None:
    change, doubt, figure = FAULTS[name]
    rig.change, broken_s = change, rig.now_s()
    rig.until(lambda: rig.gave(doubt, figure), 2.0)
    stop_s = rig.now_s()
    # A message that comes twice a second may be half a second old already when the line breaks.
    assert stop_s - broken_s <= 1.0 + 2 * TICK_S
    rig.run_for(3.0)
    after = rig.sent_since(stop_s)
    holds = [one for one in after if one.command == SET_MODE]
    assert [one.message.param2 for one in holds] == [HOLD]
    assert holds[0].time_s - stop_s == pytest.approx(2.0, abs=2 * TICK_S)
    before = [one for one in after if one.is_setpoint and one.time_s <= holds[0].time_s]
    assert before and all(one.is_standstill for one in before)
    assert max(b.time_s - a.time_s for a, b in pairwise(before)) < 0.5
    assert rig.speed_m_s < 0.05
    assert rig.simulator.collisions == ()
    held_s = rig.now_s()
    rig.run_for(5.0)
    assert_silent(rig, held_s)
    rig.change = None
    rig.run_for(5.0)
    assert_silent(rig, held_s)
    rig.pilot_mode(GUIDED)
    assert_reached(rig)


@first_of(1, "name", FAULTS)
def test_data_that_comes_back_in_time_lets_it_go_on(rig: Rig, name: str) -> None:
    change, doubt, figure = FAULTS[name]
    rig.change = change
    rig.until(lambda: rig.gave(doubt, figure), 2.0)
    stop_s = rig.now_s()
    rig.run_for(1.2)
    rig.change = None
    rig.until(lambda: rig.speed_m_s > 0.4, 6.0)
    assert_reached(rig)
    modes = [one.message.param2 for one in rig.sent_since(stop_s) if one.command == SET_MODE]
    assert modes == [HOLD], "only the one at the end"


def test_stop_and_hold_are_said_once_with_their_reason_and_not_at_every_tick(rig: Rig) -> None:
    rig.change, since_s = FAULTS["range data"][0], rig.now_s()
    rig.run_for(10.0)
    said = [one.message.text for one in rig.sent_since(since_s) if one.kind == "STATUSTEXT"]
    reason = "range data ahead silent for over 1 s"
    assert said[:2] == [f"Stopping: {reason}", f"HOLD: {reason}"] and len(said) <= 6


@pytest.mark.thorough
def test_a_rover_whose_link_fails_stops_on_ground_it_has_seen(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path))
    for metres in (1.0, 4.0, 8.0):
        rig.until_driven(metres)
        rig.cut = True
        rig.run_for(12.0)
        assert rig.speed_m_s < 0.05
        assert rig.simulator.collisions == ()
        cut_s = rig.now_s()
        rig.cut = False
        rig.until(lambda: rig.mode == HOLD, 4.0)
        assert [one for one in rig.sent_since(cut_s) if one.is_setpoint] == []
        rig.pilot_mode(GUIDED)
    assert_reached(rig)


def test_two_thirds_of_a_second_lost_are_nothing(rig: Rig) -> None:
    rig.cut = True
    rig.run_for(0.7)
    rig.cut = False
    assert_reached(rig)
    assert not rig.was_stopped


# --- where is it? ---------------------------------------------------------------------------------------------------


def shifted(north_m: float, east_m: float) -> Any:
    """The rover believes that it is elsewhere."""

    def change(message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            message.x += north_m
            message.y += east_m
        return message

    return change


@pytest.mark.thorough
def test_a_position_jump_is_noticed_and_the_map_forgotten(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=0.0)
    rig.until_driven(2.0)
    rig.run_for(2.0)
    evidence = rig.companion.evidence
    assert evidence is not None
    before = int((evidence.log_odds != 0.0).sum())
    rig.change, jump_s = shifted(0.0, -3.0), rig.now_s()
    rig.until(lambda: rig.gave(Doubt.POSITION_JUMPED), 1.0)
    said_s = rig.now_s()
    assert int((evidence.log_odds != 0.0).sum()) <= 1.05 * before  # one scan may have come before the jump
    rig.until(lambda: int((evidence.log_odds != 0.0).sum()) < before / 2, 2.0)
    between = [one for one in rig.sent if said_s <= one.time_s < rig.now_s() and one.is_setpoint]
    assert between and all(one.is_standstill for one in between)
    assert rig.now_s() - jump_s < 2.0
    rig.run_for(10.0)
    assert_setpoints_only_when_ours(rig.sent)


@pytest.mark.thorough
def test_no_target_is_given_up_while_a_position_that_jumped_may_jump_back(tmp_path: Path) -> None:
    """Eight seconds of a false position, by which the wall stands where the target is."""
    rig = Rig(yard(tmp_path, '[[target]]\nname = "gate"\nfield = [14, 7]\n'), late_s=45.0)
    rig.until_driven(1.0)
    rig.change = shifted(0.0, 6.0)
    rig.run_for(8.0)
    assert rig.gave(Doubt.POSITION_JUMPED)
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete, rig.texts()
    assert rig.times_decided(Action.UNREACHABLE, "gate") == 0


def test_a_position_that_freezes_stops_the_rover(rig: Rig) -> None:
    """The clock and the velocity go on: only the two together tell."""
    rig.until(lambda: rig.companion.vehicle.speed_m_s > 1.0)
    held: list[tuple[float, float]] = []

    def frozen(message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            held.append((message.x, message.y))
            message.x, message.y = held[0]
        return message

    rig.change, since_s = frozen, rig.now_s()
    rig.until(lambda: rig.gave(Doubt.POSITION_FROZEN), 3.0)
    assert rig.now_s() - since_s < 2.0
    rig.until(lambda: rig.mode == HOLD, 4.0)
    assert rig.simulator.collisions == ()


class Frame:
    """The autopilot moves the origin of its local frame, consistently: origin, position, and what it is told."""

    def __init__(self, north_m: float, east_m: float) -> None:
        self.north_m, self.east_m = north_m, east_m

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            message.x -= self.north_m
            message.y -= self.east_m
        elif message.get_type() == "GPS_GLOBAL_ORIGIN":
            lat_rad = math.radians(message.latitude / 1e7)
            message.latitude += round(self.north_m / 111_318.84 * 1e7)
            message.longitude += round(self.east_m / 111_318.84 / math.cos(lat_rad) * 1e7)
        return message


def test_an_origin_that_moves_takes_the_mission_with_it(tmp_path: Path) -> None:
    """Setpoints in degrees, so that the simulator, whose own origin stays, understands them."""
    rig = Rig(yard(tmp_path), parse_settings({"link": {"setpoint": "global"}}, "test"))
    rig.until_driven(5.0)
    rig.change, moved_s = Frame(20.0, -35.0), rig.now_s()
    origin = rig.companion.origin
    rig.until(lambda: rig.companion.origin != origin, 3.0)
    rig.until(lambda: rig.does(RunPhase.DRIVING), 3.0)
    positions = [one for one in rig.sent_since(moved_s + 0.2) if one.is_setpoint and one.time_s < rig.now_s() - TICK_S]
    assert positions and all(one.is_standstill for one in positions)
    assert_reached(rig)
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - 7.5, truth.east_m - 15.5) < 1.5


def test_home_that_moves_leaves_the_mission_where_it_began(rig: Rig) -> None:
    def change(message: Any) -> Any:
        if message.get_type() == "HOME_POSITION":
            message.latitude += 1000
        return message

    rig.change = change
    rig.link.ask_places()
    assert_reached(rig)
    assert [text for text in rig.texts() if "Home has moved" in text]


@pytest.mark.parametrize("form", ["local", pytest.param("global", marks=pytest.mark.thorough)])
def test_an_autopilot_that_restarts_on_the_way(tmp_path: Path, form: str) -> None:
    """It comes back disarmed, in MANUAL, with another origin: the companion waits for a person."""
    rig = Rig(yard(tmp_path), parse_settings({"link": {"setpoint": form}}, "test"))
    rig.until_driven(6.0)
    origin = rig.companion.origin
    rig.pilot(ARM, 0)
    rig.run_for(3.0)
    rig.pilot(REBOOT, 1)
    rig.until(lambda: rig.mode == MANUAL, 5.0)
    since_s = rig.now_s()
    rig.run_for(5.0)
    assert rig.gave(LatchReason.OTHER_MODE) and rig.awaits(WaitReason.GOOD_DATA_AND)
    rig.run_for(45.0)
    assert rig.awaits(WaitReason.PERSON_SETS_MODE_AND_ARMS)
    assert_silent(rig, since_s)
    assert rig.companion.origin != origin
    rig.pilot_mode(GUIDED)
    rig.pilot(ARM, 1)
    assert_reached(rig)
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - 7.5, truth.east_m - 15.5) < 1.5


@first_of(1, "form", ["global", "mission-item", "reposition"])
def test_what_cannot_be_said_stops_the_rover_and_not_the_companion(tmp_path: Path, form: str) -> None:
    rig = Rig(yard(tmp_path), parse_settings({"link": {"setpoint": form}}, "test"))
    rig.until_driven(2.0)
    decoder = rig.link.codec._decoder  # as after a restart that has not been noticed otherwise
    origin, decoder.origin = decoder.origin, None
    rig.change, since_s = without("GPS_GLOBAL_ORIGIN"), rig.now_s()
    rig.run_for(3.0)
    sent = [one for one in rig.sent_since(since_s) if one.is_setpoint]
    assert any(one.is_standstill for one in sent)
    assert any("origin" in text for text in rig.texts())
    assert rig.speed_m_s < 0.1
    decoder.origin, rig.change = origin, None
    assert_reached(rig)


# --- driving --------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("form", "kind"),
    [
        pytest.param("local", "SET_POSITION_TARGET_LOCAL_NED", marks=pytest.mark.thorough),  # all other drives
        pytest.param("global", "SET_POSITION_TARGET_GLOBAL_INT", marks=pytest.mark.thorough),
        pytest.param("mission-item", "MISSION_ITEM_INT", marks=pytest.mark.thorough),
        ("reposition", "COMMAND_INT"),
    ],
)
def test_every_form_of_setpoint_drives(form: str, kind: str) -> None:
    rig = Rig(load_mission(MISSIONS / "one-obstacle.toml"), parse_settings({"link": {"setpoint": form}}, "test"))
    assert_reached(rig)
    assert sum(one.kind == kind for one in rig.sent) > 30
    others = {one.kind for one in rig.sent if one.is_setpoint} - {kind, "SET_POSITION_TARGET_LOCAL_NED"}
    assert others == set()


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name",
    ["clutter.toml", *(pytest.param(f"{name}.toml", marks=pytest.mark.thorough) for name in ("one-obstacle", "rooms"))],
)
def test_no_guided_position_lies_beyond_what_was_seen_free(name: str) -> None:
    """At most by the way the rover needs to stop at cruise speed, and half a metre."""
    settings = Settings()
    mission = load_mission(MISSIONS / name)
    rig = Rig(mission, settings)
    rig.finish(1500.0)
    speed_m_s = mission.rover.cruise_speed_m_s
    stopping_m = speed_m_s**2 / (2.0 * settings.guidance.deceleration_m_s2) + speed_m_s * settings.guidance.latency_s
    assert len(rig.beyond_m) > 50
    assert max(rig.beyond_m) <= stopping_m + 0.5
    assert rig.simulator.collisions == ()


def targets(on_blocked: str) -> str:
    sealed = f'[[target]]\nname = "sealed"\nfield = [15, 7]\non_blocked = "{on_blocked}"\n'
    return sealed + '[[target]]\nname = "corner"\nfield = [20, 1]\n'


@pytest.mark.parametrize(
    ("on_blocked", "statuses", "end"),
    [
        pytest.param("skip", [UNREACHABLE, REACHED], (1.5, 20.5), marks=pytest.mark.thorough),
        pytest.param("wait", [UNREACHABLE, REACHED], (1.5, 20.5), marks=pytest.mark.thorough),
        ("return", [UNREACHABLE, SKIPPED], (7.5, 2.5)),
        pytest.param("hold", [UNREACHABLE, SKIPPED], (7.5, 2.5), marks=pytest.mark.thorough),
    ],
)
def test_a_sealed_target(
    tmp_path: Path, on_blocked: str, statuses: list[TargetStatus], end: tuple[float, float]
) -> None:
    """Unreachable is said where the leg began; then the mission's own word counts."""
    settings = parse_settings({"navigator": {"wait_limit_s": 20.0, "wait_retry_s": 3.0}}, "test")
    rig = Rig(yard(tmp_path, targets(on_blocked), sealed=True), settings)
    waited: list[float] = []
    rig.until(lambda: rig.times_decided(Action.UNREACHABLE, "sealed") > 0, 400.0)
    while not rig.companion.done:
        rig.companion.tick()
        if rig.does(RunPhase.WAY_BLOCKED):
            waited.append(rig.now_s())
    assert [status for _, status in rig.companion.statuses()] == statuses
    assert rig.simulator.collisions == ()
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - end[0], truth.east_m - end[1]) < 1.5
    assert bool(waited) == (on_blocked == "wait")
    if waited:
        pauses = [b - a for a, b in pairwise(waited) if b - a > 1.5 * TICK_S]
        assert len(waited) == pytest.approx((len(pauses) + 1) * 3.0 / TICK_S, abs=2 * len(pauses) + 2), "3 s each"
        assert rig.times_decided(Action.UNREACHABLE, "sealed") >= 2, "tried again, then given up"
    rig.simulator.advance_to_s(rig.now_s() + 2.0)
    assert rig.speed_m_s < 0.05


def test_stop_leaves_the_rover_standing_in_hold(rig: Rig) -> None:
    rig.companion.stop()
    since_s = rig.now_s()
    rig.finish(2.0)
    commands = [one for one in rig.sent_since(since_s) if one.moves_or_changes]
    assert commands[0].is_standstill and commands[1].command == SET_MODE
    assert rig.now_s() - since_s < 1.0
    assert rig.gave(EndReason.STOPPED_BY_USER)
    driven_m = rig.simulator.driven_m
    rig.simulator.advance_to_s(rig.now_s() + 3.0)
    assert rig.speed_m_s < 0.05 and rig.simulator.driven_m - driven_m < 1.2
    rig.simulator.advance_to_s(rig.now_s() + 10.0)
    assert rig.simulator.driven_m - driven_m < 1.2


def test_stop_does_not_touch_a_rover_that_a_person_drives(rig: Rig) -> None:
    rig.pilot_mode(MANUAL)
    rig.until(lambda: rig.mode == MANUAL, 1.5)
    since_s = rig.now_s()
    rig.companion.stop()
    rig.finish(2.0)
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []


def test_an_error_in_the_program_leaves_the_rover_standing_in_hold(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(rig.companion.driver, "guide", broken)
    with pytest.raises(ZeroDivisionError):
        rig.run_for(1.0)
    since_s = rig.now_s()
    rig.companion.close()
    assert rig.now_s() - since_s < 1.0
    assert [one.message.param2 for one in rig.sent_since(since_s) if one.command == SET_MODE] == [HOLD]
    rig.companion.close()
    rig.simulator.advance_to_s(rig.now_s() + 3.0)
    assert rig.speed_m_s < 0.05 and rig.simulator.collisions == ()
