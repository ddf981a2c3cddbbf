"""Who may drive: the mode latch as a table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import GeoPoint
from companion.core.scan import RangeScan
from companion.safety.mode_latch import Control, LatchState, Reaction, Verdict, awaited, check, latched
from companion.safety.reasons import WAITED_OUT, Doubt, LatchReason, Reason, WaitReason
from companion.safety.watchdogs import DataMonitor, SticksMonitor, first_doubt
from companion.settings import SafetySettings, Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import (
    AttitudeSeen,
    EkfStatusSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    RangeSeen,
    RoverMode,
)
from companion.vehicle.state import VehicleState

SETTINGS = SafetySettings()
SCAN = RangeScan(0.0, np.zeros(1), np.ones(1), 0.1, 8.0, 0.1, "test")
EKF_GOOD = 831
PLACE = GeoPoint(1.0, 2.0)
GUIDED, MANUAL, HOLD = RoverMode.GUIDED, RoverMode.MANUAL, RoverMode.HOLD


def vehicle(now_s: float = 10.0, mode: int = GUIDED, *, armed: bool = True, ekf: int = EKF_GOOD) -> VehicleState:
    """Everything heard just now."""
    return VehicleState(
        heartbeat=HeartbeatSeen(now_s, mode, armed, 1),
        position=LocalPositionSeen(now_s, now_s, 0.0, 0.0, 0.0, 0.0),
        attitude=AttitudeSeen(now_s, now_s, 0.0, 0.0),
        ekf=EkfStatusSeen(now_s, ekf),
        scan=RangeSeen(now_s, SCAN),
        scan_ahead=RangeSeen(now_s, SCAN),
        origin=OriginSeen(now_s, PLACE),
        home=HomeSeen(now_s, PLACE),
    )


def doubt_of(seen: VehicleState, now_s: float) -> Doubt | None:
    """What the sticks and the data give reason to doubt."""
    monitors = (SticksMonitor(), DataMonitor(LiveSettings(Settings())))
    for monitor in monitors:
        monitor.take(EkfStatusSeen(now_s, 0), seen)
    found = first_doubt(monitors, now_s)
    return None if found is None else found.kind


def checked(watch: LatchState, seen: VehicleState, now_s: float) -> tuple[LatchState, Verdict]:
    """The latch, told of that."""
    found = doubt_of(seen, now_s)
    return check(watch, seen, now_s, SETTINGS, None if found is None else Reason(found))


UNSAFE = vehicle(ekf=0)
NOBODY, OURS, THEIRS = LatchState(), LatchState(Control.COMPANION), LatchState(Control.PERSON)
STOPPED = LatchState(Control.COMPANION, unsafe_since_s=9.0)
LONG_STOPPED = LatchState(Control.COMPANION, unsafe_since_s=8.0)
JUMPED = Reason(Doubt.POSITION_JUMPED)
HELD = LatchState(Control.PERSON, hold_sent=True)


@pytest.mark.parametrize(
    ("watch", "seen", "reaction", "control"),
    [
        # Nobody has driven yet: silent until GUIDED and armed.
        (NOBODY, VehicleState(), Reaction.SILENT, Control.NOBODY),
        (NOBODY, vehicle(mode=MANUAL), Reaction.SILENT, Control.NOBODY),
        (NOBODY, vehicle(armed=False), Reaction.SILENT, Control.COMPANION),
        (NOBODY, vehicle(), Reaction.DRIVE, Control.COMPANION),
        (NOBODY, UNSAFE, Reaction.STOP, Control.COMPANION),
        # The companion drives: any other mode silences it, disarming too.
        (OURS, vehicle(), Reaction.DRIVE, Control.COMPANION),
        (OURS, vehicle(mode=MANUAL), Reaction.SILENT, Control.PERSON),
        (OURS, vehicle(mode=HOLD), Reaction.SILENT, Control.PERSON),
        (OURS, vehicle(mode=RoverMode.RTL), Reaction.SILENT, Control.PERSON),
        (OURS, vehicle(armed=False), Reaction.SILENT, Control.COMPANION),
        (OURS, UNSAFE, Reaction.STOP, Control.COMPANION),
        # A person drives: only GUIDED gives the rover back.
        (THEIRS, vehicle(mode=MANUAL), Reaction.SILENT, Control.PERSON),
        (THEIRS, vehicle(mode=RoverMode.AUTO), Reaction.SILENT, Control.PERSON),
        (THEIRS, vehicle(), Reaction.DRIVE, Control.COMPANION),
        # Unsafe: stop, after hold_after_s HOLD, then silence until a person returns the rover to GUIDED.
        (STOPPED, vehicle(), Reaction.DRIVE, Control.COMPANION),
        (STOPPED, UNSAFE, Reaction.STOP, Control.COMPANION),
        (LONG_STOPPED, UNSAFE, Reaction.HOLD, Control.PERSON),
        (LONG_STOPPED, vehicle(mode=MANUAL, ekf=0), Reaction.SILENT, Control.PERSON),
        (HELD, UNSAFE, Reaction.SILENT, Control.PERSON),
        (HELD, vehicle(), Reaction.SILENT, Control.PERSON),
        (HELD, vehicle(mode=HOLD), Reaction.SILENT, Control.PERSON),
    ],
)
def test_latch_and_watchdogs(watch, seen, reaction, control):
    after, verdict = checked(watch, seen, 10.0)
    assert (verdict.reaction, after.control) == (reaction, control)
    assert (verdict.reason is not None) == (reaction in (Reaction.STOP, Reaction.HOLD)) or reaction is Reaction.SILENT


def test_after_our_own_hold_a_person_gives_the_rover_back():
    watch, verdict = checked(LONG_STOPPED, UNSAFE, 10.0)
    assert verdict.reaction is Reaction.HOLD
    for seen, reaction in (
        (vehicle(10.1), Reaction.SILENT),  # the heartbeat of before
        (vehicle(11.0, HOLD), Reaction.SILENT),
        (vehicle(12.0, HOLD), Reaction.SILENT),
        (vehicle(13.0, GUIDED), Reaction.DRIVE),
    ):
        watch, verdict = checked(watch, seen, seen.heartbeat.time_s)
        assert verdict.reaction is reaction


def test_a_hold_that_was_lost_is_sent_again_when_the_vehicle_is_heard_again():
    watch, _ = checked(LONG_STOPPED, UNSAFE, 10.0)
    silent = vehicle(10.0)
    for now_s in (11.0, 15.0, 30.0):
        watch, verdict = checked(watch, silent, now_s)
        assert verdict.reaction is Reaction.SILENT, "nobody there"
    watch, verdict = checked(watch, vehicle(31.0), 31.0)
    assert verdict.reaction is Reaction.HOLD
    watch, verdict = checked(watch, vehicle(31.1), 31.1)
    assert verdict.reaction is Reaction.SILENT
    watch, verdict = checked(watch, vehicle(32.0, HOLD), 32.0)
    assert (watch, verdict.reaction) == (THEIRS, Reaction.SILENT)


@pytest.mark.parametrize(("after_s", "reaction"), [(1.9, Reaction.SILENT), (2.0, Reaction.HOLD)])
def test_a_heartbeat_in_guided_two_seconds_after_hold_means_that_it_was_lost(after_s, reaction):
    watch, _ = check(OURS, vehicle(), 10.0, SETTINGS, Reason(Doubt.STICKS_MOVED))
    watch, verdict = check(watch, vehicle(10.0 + after_s), 13.0, SETTINGS, None)
    lost = reaction is Reaction.HOLD
    assert verdict == Verdict(reaction, Reason(LatchReason.HOLD_LOST if lost else LatchReason.HOLD_SENT))
    assert watch.hold_s == (13.0 if lost else 10.0)


def test_any_doubt_stops_and_holds():
    watch, verdict = check(OURS, vehicle(), 10.0, SETTINGS, JUMPED)
    assert verdict == Verdict(Reaction.STOP, JUMPED)
    assert check(watch, vehicle(11.0), 11.0, SETTINGS, None)[1].reaction is Reaction.DRIVE
    watch, verdict = check(watch, vehicle(12.0), 12.0, SETTINGS, JUMPED)
    assert verdict == Verdict(Reaction.HOLD, JUMPED)


def test_sticks_that_were_moved_are_a_hold_at_once():
    sticks = Reason(Doubt.STICKS_MOVED)
    watch, verdict = check(OURS, vehicle(), 10.0, SETTINGS, sticks)
    assert verdict == Verdict(Reaction.HOLD, sticks) and watch.control is Control.PERSON


@pytest.mark.parametrize("control", list(Control))
def test_the_latch_follows_the_mode(control):
    assert latched(control, VehicleState()) is (Control.NOBODY if control is Control.NOBODY else Control.PERSON)
    assert latched(control, vehicle()) is Control.COMPANION
    assert latched(control, vehicle(mode=HOLD)) is (Control.NOBODY if control is Control.NOBODY else Control.PERSON)


def test_a_short_gap_stops_and_does_not_hold():
    watch = OURS
    for now_s, seen, reaction in (
        (10.0, UNSAFE, Reaction.STOP),
        (11.9, replace(vehicle(11.9), ekf=EkfStatusSeen(11.9, 0)), Reaction.STOP),
        (12.0, vehicle(12.0), Reaction.DRIVE),
        (13.0, replace(vehicle(13.0), ekf=EkfStatusSeen(13.0, 0)), Reaction.STOP),
        (14.9, replace(vehicle(14.9), ekf=EkfStatusSeen(14.9, 0)), Reaction.STOP),
        (15.0, replace(vehicle(15.0), ekf=EkfStatusSeen(15.0, 0)), Reaction.HOLD),
    ):
        watch, verdict = checked(watch, seen, now_s)
        assert verdict.reaction is reaction, now_s


def test_doubts_before_disarming_do_not_count_afterwards():
    watch, verdict = checked(LONG_STOPPED, vehicle(armed=False, ekf=0), 10.0)
    assert verdict == Verdict(Reaction.SILENT, Reason(LatchReason.DISARMED))
    watch, verdict = checked(watch, UNSAFE, 10.1)
    assert verdict.reaction is Reaction.STOP and watch.unsafe_since_s == 10.1


def test_the_words_by_which_a_state_file_names_who_drives():
    assert [str(control) for control in Control] == ["nobody", "companion", "person"]


@given(st.lists(st.tuples(st.sampled_from([0, 4, 10, 11, 15]), st.booleans(), st.booleans()), max_size=40))
def test_whatever_happens_setpoints_go_out_only_while_guided_and_armed(story):
    watch = LatchState()
    for i, (mode, armed, good) in enumerate(story):
        now_s = 0.7 * i
        watch, verdict = checked(watch, vehicle(now_s, mode, armed=armed, ekf=EKF_GOOD if good else 0), now_s)
        if verdict.reaction is not Reaction.SILENT:
            assert mode == GUIDED and armed
        if verdict.reaction is Reaction.DRIVE:
            assert good


SETS_GUIDED = Reason(WaitReason.PERSON_SETS_MODE, ("GUIDED",))


@pytest.mark.parametrize(
    ("seen", "now_s", "expected"),
    [
        (vehicle(), 10.0, None),
        (VehicleState(), 10.0, Reason(WaitReason.AUTOPILOT_HEARD)),
        (vehicle(), 10.0 + SETTINGS.heartbeat_s, None),
        (vehicle(), 10.0 + SETTINGS.heartbeat_s + 0.1, Reason(WaitReason.AUTOPILOT_HEARD)),
        (vehicle(mode=HOLD), 10.0, SETS_GUIDED),
        (replace(vehicle(mode=HOLD), in_auto=True), 10.0, Reason(WaitReason.PERSON_SETS_MODE, ("AUTO",))),
        (vehicle(armed=False), 10.0, Reason(WaitReason.PERSON_ARMS_AGAIN)),
        (vehicle(mode=HOLD, armed=False), 10.0, Reason(WaitReason.PERSON_SETS_MODE_AND_ARMS, ("GUIDED",))),
        (
            vehicle(mode=HOLD, ekf=0),
            10.0,
            Reason(WaitReason.GOOD_DATA_AND, (Reason(Doubt.EKF_INCOMPLETE, ("position",)), SETS_GUIDED)),
        ),
    ],
)
def test_what_a_silent_companion_waits_for(seen, now_s, expected):
    assert awaited(seen, now_s, SETTINGS) == expected


@pytest.mark.parametrize(
    ("seen", "reason"),
    [
        (VehicleState(), Reason(LatchReason.OTHER_MODE, ("GUIDED",))),
        (vehicle(mode=HOLD), Reason(LatchReason.OTHER_MODE, ("GUIDED",))),
        (replace(vehicle(mode=HOLD), in_auto=True), Reason(LatchReason.OTHER_MODE, ("AUTO",))),
        (replace(vehicle(mode=RoverMode.AUTO), in_auto=True), Reason(LatchReason.BETWEEN_LEGS)),
    ],
)
def test_a_mode_that_is_not_ours_is_named(seen, reason):
    assert check(THEIRS, seen, 10.0, SETTINGS, None) == (THEIRS, Verdict(Reaction.SILENT, reason))


def test_before_anybody_has_had_the_rover_there_is_nothing_to_name():
    assert check(NOBODY, vehicle(mode=HOLD), 10.0, SETTINGS, None) == (NOBODY, Verdict(Reaction.SILENT))


@pytest.mark.parametrize("kind", sorted(WAITED_OUT, key=lambda kind: kind.name))
def test_what_is_waited_out_stops_the_rover_for_as_long_as_it_lasts_and_never_leads_to_hold(kind: Doubt) -> None:
    latch = OURS
    for now_s in (10.0, 11.0, 60.0, 600.0):
        latch, verdict = check(latch, vehicle(now_s), now_s, SETTINGS, Reason(kind))
        assert verdict.reaction is Reaction.STOP
    latch, verdict = check(latch, vehicle(601.0), 601.0, SETTINGS, JUMPED)
    assert verdict.reaction is Reaction.STOP, "another doubt has its whole time from when it arose"
    assert check(latch, vehicle(603.1), 603.1, SETTINGS, JUMPED)[1].reaction is Reaction.HOLD
    assert check(OURS, vehicle(mode=MANUAL), 10.0, SETTINGS, Reason(kind))[1].reaction is Reaction.SILENT
