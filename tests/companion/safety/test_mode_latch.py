"""Who may drive: the pilot-wins latch and the watchdogs as a table, and the way to the first metre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import GeoPoint
from companion.core.scan import RangeScan
from companion.safety.mode_latch import Control, LatchState, Reaction, Verdict, check, latched, unsafe_reason
from companion.settings import SafetySettings
from companion.supervision.startup import start_step
from companion.vehicle.commands import Arm, SetMode
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


UNSAFE = vehicle(ekf=0)
NOBODY, OURS, THEIRS = LatchState(), LatchState(Control.COMPANION), LatchState(Control.PERSON)
STOPPED = LatchState(Control.COMPANION, unsafe_since_s=9.0)
LONG_STOPPED = LatchState(Control.COMPANION, unsafe_since_s=8.0)
HELD = LatchState(Control.PERSON, 7.0, hold_sent=True)


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
    after, verdict = check(watch, seen, 10.0, SETTINGS)
    assert (verdict.reaction, after.control) == (reaction, control)
    assert bool(verdict.reason) == (reaction in (Reaction.STOP, Reaction.HOLD)) or reaction is Reaction.SILENT


def test_after_our_own_hold_a_person_gives_the_rover_back():
    watch, verdict = check(LONG_STOPPED, UNSAFE, 10.0, SETTINGS)
    assert verdict.reaction is Reaction.HOLD
    for seen, reaction in (
        (vehicle(10.1), Reaction.SILENT),  # the heartbeat of before
        (vehicle(11.0, HOLD), Reaction.SILENT),
        (vehicle(12.0, HOLD), Reaction.SILENT),
        (vehicle(13.0, GUIDED), Reaction.DRIVE),
    ):
        watch, verdict = check(watch, seen, seen.heartbeat.time_s, SETTINGS)
        assert verdict.reaction is reaction


def test_a_hold_that_was_lost_is_sent_again_when_the_vehicle_is_heard_again():
    watch, _ = check(LONG_STOPPED, UNSAFE, 10.0, SETTINGS)
    silent = vehicle(10.0)
    for now_s in (11.0, 15.0, 30.0):
        watch, verdict = check(watch, silent, now_s, SETTINGS)
        assert verdict.reaction is Reaction.SILENT, "nobody there"
    watch, verdict = check(watch, vehicle(31.0), 31.0, SETTINGS)
    assert verdict.reaction is Reaction.HOLD
    watch, verdict = check(watch, vehicle(31.1), 31.1, SETTINGS)
    assert verdict.reaction is Reaction.SILENT
    watch, verdict = check(watch, vehicle(32.0, HOLD), 32.0, SETTINGS)
    assert (watch, verdict.reaction) == (THEIRS, Reaction.SILENT)


def test_a_doubt_of_the_callers_own_stops_and_holds():
    watch, verdict = check(OURS, vehicle(), 10.0, SETTINGS, "position jumped")
    assert verdict == Verdict(Reaction.STOP, "position jumped")
    assert check(watch, vehicle(11.0), 11.0, SETTINGS)[1].reaction is Reaction.DRIVE
    watch, verdict = check(watch, vehicle(12.0), 12.0, SETTINGS, "position jumped")
    assert verdict == Verdict(Reaction.HOLD, "position jumped")


@pytest.mark.parametrize("control", list(Control))
def test_the_latch_follows_the_mode(control):
    assert latched(control, VehicleState()) is (Control.NOBODY if control is Control.NOBODY else Control.PERSON)
    assert latched(control, vehicle()) is Control.COMPANION
    assert latched(control, vehicle(mode=HOLD)) is (Control.NOBODY if control is Control.NOBODY else Control.PERSON)


@pytest.mark.parametrize("mode", [MANUAL, HOLD])
@pytest.mark.parametrize("armed", [True, False])
def test_a_rover_that_a_person_took_out_of_guided_is_not_put_back(mode, armed):
    seen = vehicle(mode=mode, armed=armed)
    step = start_step(seen, 10.0, SETTINGS, arm=True, control=Control.PERSON)
    assert step.command is None and "a person to set GUIDED" in step.missing


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
        watch, verdict = check(watch, seen, now_s, SETTINGS)
        assert verdict.reaction is reaction, now_s


@given(st.lists(st.tuples(st.sampled_from([0, 4, 10, 11, 15]), st.booleans(), st.booleans()), max_size=40))
def test_whatever_happens_setpoints_go_out_only_while_guided_and_armed(story):
    watch = LatchState()
    for i, (mode, armed, good) in enumerate(story):
        now_s = 0.7 * i
        watch, verdict = check(watch, vehicle(now_s, mode, armed=armed, ekf=EKF_GOOD if good else 0), now_s, SETTINGS)
        if verdict.reaction is not Reaction.SILENT:
            assert mode == GUIDED and armed
        if verdict.reaction is Reaction.DRIVE:
            assert good


@pytest.mark.parametrize("name", ["heartbeat", "position", "attitude", "scan_ahead", "ekf"])
def test_what_is_missing_or_stale_is_unsafe(name):
    good = vehicle(10.0)
    assert unsafe_reason(good, 10.9, SETTINGS) == ""
    assert unsafe_reason(replace(good, **{name: None}), 10.0, SETTINGS).startswith("no ")
    limit_s = SETTINGS.heartbeat_s if name == "heartbeat" else SETTINGS.stale_s
    fresh = vehicle(20.0)
    old = replace(fresh, **{name: getattr(vehicle(20.0 - limit_s - 0.1), name)})
    assert "silent for" in unsafe_reason(old, 20.0, SETTINGS)
    assert unsafe_reason(replace(fresh, **{name: getattr(vehicle(20.0 - limit_s), name)}), 20.0, SETTINGS) == ""


@pytest.mark.parametrize(
    ("flags", "ok"), [(831, True), (3 | 8, True), (3 | 16, True), (7, False), (831 | 128, False), (0, False)]
)
def test_the_ekf_must_have_a_position(flags, ok):
    assert (unsafe_reason(vehicle(ekf=flags), 10.0, SETTINGS) == "") is ok


@pytest.mark.parametrize(
    ("seen", "arm", "missing", "command"),
    [
        (VehicleState(), True, "heartbeat", None),
        (replace(vehicle(), origin=None), True, "origin and home", None),
        (replace(vehicle(), home=None), True, "origin and home", None),
        (vehicle(ekf=0), True, "good data (EKF", None),
        (replace(vehicle(), scan_ahead=None), True, "range data", None),
        (vehicle(mode=MANUAL, armed=False), False, "GUIDED", SetMode(GUIDED)),
        (vehicle(mode=HOLD, armed=False), False, "GUIDED", SetMode(GUIDED)),
        (vehicle(mode=HOLD), False, "GUIDED", SetMode(GUIDED)),
        (vehicle(mode=MANUAL), True, "a person to set GUIDED", None),
        (vehicle(mode=RoverMode.AUTO), True, "a person to set GUIDED", None),
        (vehicle(armed=False), True, "arming", Arm()),
        (vehicle(armed=False), False, "a person to arm", None),
        (vehicle(), False, "", None),
        (vehicle(), True, "", None),
    ],
)
def test_the_way_to_the_first_metre(seen, arm, missing, command):
    step = start_step(seen, 10.0, SETTINGS, arm=arm)
    assert missing in step.missing and bool(missing) == bool(step.missing)
    assert step.command == command
