"""The pilot wins at any moment: after the heartbeat that shows it no setpoint is sent, and no mode is changed back."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.navigation.field_step import Part
from companion.safety.reasons import Doubt, RunPhase, WaitReason
from tests.support.quick import first_of
from tests.support.rig import ARM, GUIDED, HOLD, MANUAL, SET_MODE, Rig, without, yard

HEADING_ONLY, POSITION_ONLY = 2559, 3580
"""Type masks."""
HELD = '[[target]]\nname = "held"\nfield = [2, 11]\nhold_s = 4.0\n'
SEALED = '[[target]]\nname = "sealed"\nfield = [15, 7]\non_blocked = "wait"\n'
ON_FOR_S = 50.0
"""The vehicle has been switched on for so long: it could be armed at once."""


def rig_for(phase: str, folder: Path) -> Rig:
    """A mission that has such a phase."""
    if phase == "waiting for the way to clear":
        return Rig(yard(folder, SEALED, sealed=True), late_s=ON_FOR_S)
    mission = yard(folder, HELD) if phase in ("turning", "holding at a target") else yard(folder)
    return Rig(mission, late_s=ON_FOR_S)


def last_mask(rig: Rig) -> int:
    setpoints = [one for one in rig.sent[-200:] if one.is_setpoint]
    return int(setpoints[-1].message.type_mask) if setpoints else 0


def asking_for_guided(rig: Rig) -> None:
    """The mode change is on its way and not answered."""
    rig.until(lambda: any(one.command == SET_MODE for one in rig.sent), 60.0)


def waiting_for_arming(rig: Rig) -> None:
    rig.until(lambda: rig.awaits(WaitReason.ARMING), 60.0)


def turning(rig: Rig) -> None:
    rig.until(lambda: last_mask(rig) == HEADING_ONLY, 60.0)


def driving(rig: Rig) -> None:
    rig.until(lambda: rig.speed_m_s > 0.5 and last_mask(rig) == POSITION_ONLY, 60.0)


def searching(rig: Rig) -> None:
    def is_searching() -> bool:
        driver = rig.companion.driver
        return driver is not None and driver.decision is not None and driver.decision.part is Part.SEARCH

    rig.until(is_searching, 200.0)


def holding_at_a_target(rig: Rig) -> None:
    rig.until(lambda: rig.does(RunPhase.STAYING), 100.0)


def waiting_for_the_way_to_clear(rig: Rig) -> None:
    rig.until(lambda: rig.does(RunPhase.WAY_BLOCKED), 200.0)


def backing_out(rig: Rig) -> None:
    """The wheels spin until the rover thinks that it is stuck."""
    driving(rig)
    rig.simulator._rover["grip_1"] = rig.simulator._rover["grip_3"] = 0.0
    rig.until(lambda: any(one.is_setpoint and one.message.vx < 0.0 for one in rig.sent[-5:]), 20.0)
    rig.simulator._rover["grip_1"] = rig.simulator._rover["grip_3"] = 1.0


def stopped_by_a_watchdog(rig: Rig) -> None:
    driving(rig)
    rig.change = without("OBSTACLE_DISTANCE")
    rig.until(lambda: rig.gave(Doubt.DATA_OLD, "range data ahead"), 3.0)


def asking_for_hold(rig: Rig) -> None:
    """The watchdog's HOLD has just gone out, and is not answered."""
    stopped_by_a_watchdog(rig)
    rig.until(lambda: rig.companion.mission_run.latch.hold_sent, 3.0)


def handing_over(rig: Rig) -> None:
    driving(rig)
    rig.companion.stop()
    rig.companion.tick()


PHASES = {phase.__name__.replace("_", " "): phase for phase in (
    asking_for_guided, waiting_for_arming, turning, driving, searching, holding_at_a_target,
    waiting_for_the_way_to_clear, backing_out, stopped_by_a_watchdog, asking_for_hold, handing_over,
)}  # fmt: skip


def assert_silent_from_here(rig: Rig, seconds: float = 6.0) -> None:
    """Not one packet that moves the rover or changes its mode, arming or speed."""
    since_s = rig.now_s()
    rig.run_for(seconds)
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []


def assert_setpoints_only_when_ours(rig: Rig) -> None:
    assert all(one.mode == GUIDED and one.armed for one in rig.sent if one.is_setpoint)


@first_of(3, ("phase", "mode"), list(zip(PHASES, cycle([MANUAL, HOLD]), strict=False)))
def test_a_mode_change_at_any_phase_silences_it_for_good(tmp_path: Path, phase: str, mode: int) -> None:
    rig = rig_for(phase, tmp_path)
    PHASES[phase](rig)
    rig.pilot_mode(mode)
    rig.until(lambda: rig.mode == mode, 0.5)
    rig.change = None
    assert_silent_from_here(rig)
    assert rig.mode == mode
    assert_setpoints_only_when_ours(rig)


@first_of(2, "phase", ["turning", "driving", "backing out", "stopped by a watchdog", "handing over"])
def test_disarming_at_any_phase_silences_it_for_good(tmp_path: Path, phase: str) -> None:
    rig = rig_for(phase, tmp_path)
    PHASES[phase](rig)
    rig.pilot(ARM, 0)
    rig.until(lambda: rig.armed is False, 1.5)
    rig.change = None
    assert_silent_from_here(rig)
    assert rig.armed is False
    assert_setpoints_only_when_ours(rig)


# --- sticks ---------------------------------------------------------------------------------------------------------


def hold_sticks(rig: Rig, steering_us: int, throttle_us: int, seconds: float) -> None:
    """A ground station's joystick. ArduRover shows it in RC_CHANNELS, and in GUIDED it obeys no sticks."""
    until_s = rig.now_s() + seconds
    while rig.now_s() < until_s - 1e-9 and not rig.companion.done:
        rest = [65535] * 4
        override = mavlink.MAVLink_rc_channels_override_message(1, 1, steering_us, 65535, throttle_us, 65535, *rest)
        rig._pilot.receive(override.pack(rig._pilot_mav))
        rig.run_for(0.2)


@first_of(
    2,
    ("phase", "sticks_us"),
    [
        ("turning", (1700, 1500)),
        ("driving", (1500, 1300)),
        ("backing out", (1380, 1500)),
        ("holding at a target", (1500, 1700)),
    ],
)
def test_sticks_that_are_moved_in_guided_take_the_rover_away(
    tmp_path: Path, phase: str, sticks_us: tuple[int, int]
) -> None:
    rig = rig_for(phase, tmp_path)
    PHASES[phase](rig)
    rig.run_for(0.5)  # the sticks have been seen at rest
    since_s = rig.now_s()
    hold_sticks(rig, *sticks_us, 0.8)
    hold = next(one for one in rig.sent_since(since_s) if one.command == SET_MODE)
    assert hold.message.param2 == HOLD and hold.time_s - since_s <= 0.6
    rig.until(lambda: rig.mode == HOLD, 0.5)
    rig.run_for(5.0)
    after = [one for one in rig.sent_since(hold.time_s) if one.moves_or_changes]
    assert [one.command for one in after if one.command] == [SET_MODE]
    assert not [one for one in after if one.is_setpoint and one.time_s > hold.time_s]
    assert rig.gave(Doubt.STICKS_MOVED) and rig.speed_m_s < 0.05


def test_sticks_that_tremble_or_are_let_go_take_nothing(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), arm=False, late_s=ON_FOR_S)
    rig.until(lambda: rig.mode == GUIDED, 5.0)
    hold_sticks(rig, 1700, 1650, 1.0)
    rig.pilot(ARM, 1)
    hold_sticks(rig, 1700, 1650, 1.0)
    hold_sticks(rig, 1580, 1450, 1.0)
    hold_sticks(rig, 1450, 1560, 1.0)
    rig.finish()
    assert rig.companion.outcome.complete


# --- races ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [MANUAL, HOLD])
@first_of(1, "lost", [False, True], ids=["heard", "the heartbeat between is lost"])
def test_a_person_who_changes_the_mode_in_the_tick_in_which_the_companion_does_is_not_overruled(
    tmp_path: Path, mode: int, lost: bool
) -> None:
    """The rover is armed in HOLD, so the companion sets GUIDED; in that very tick the person chooses otherwise."""
    rig = Rig(yard(tmp_path), late_s=ON_FOR_S)
    rig.pilot_mode(HOLD)
    rig.pilot(ARM, 1)
    rig.simulator.advance_to_s(ON_FOR_S + 1.0)
    if lost:
        rig.change = lambda m: None if m.get_type() == "HEARTBEAT" and m.custom_mode == GUIDED else m
    while not any(one.command == SET_MODE for one in rig.sent):
        rig.companion.tick()
    rig.pilot_mode(mode)
    rig.run_for(20.0)
    assert [one.message.param2 for one in rig.sent if one.command == SET_MODE] == [GUIDED]
    assert rig.mode == mode and rig.simulator.driven_m < 0.1
    assert rig.awaits_guided


def test_a_speed_whose_answer_was_lost_is_not_said_again_to_a_rover_that_a_person_drives(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=ON_FOR_S)
    rig.change = without("COMMAND_ACK")
    rig.until_driven(2.0)
    rig.pilot_mode(MANUAL)
    rig.until(lambda: rig.mode == MANUAL, 0.5)
    assert_silent_from_here(rig)


@first_of(1, "seed", range(5))
def test_at_any_moment_whatever_the_pilot_does_wins(tmp_path: Path, seed: int) -> None:
    """Lock-step, at random ticks from arming on: mode switch, arming switch, sticks; then it is given back."""
    rig, rng = Rig(yard(tmp_path), seed=seed, late_s=ON_FOR_S), np.random.default_rng([seed, 4711])
    rig.until(lambda: rig.armed)
    for _ in range(6):
        rig.run_for(float(rng.integers(1, 100)) * 0.05)
        if rig.companion.done:
            break
        what = int(rng.integers(4))
        if what == 0:
            rig.pilot(ARM, 0)
        elif what == 1 and rig.companion.driver is not None:
            hold_sticks(rig, 1500 + int(rng.choice([-300, 300])), 1500, 1.0)
        else:
            rig.pilot_mode(int(rng.choice([MANUAL, HOLD])))
        rig.run_for(1.1)
        assert_silent_from_here(rig, 3.5)
        rig.pilot_mode(GUIDED)
        rig.pilot(ARM, 1)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert_setpoints_only_when_ours(rig)
    ours = [one for one in rig.sent if one.command in (SET_MODE, ARM)]
    begun_s = next(one.time_s for one in rig.sent if one.is_setpoint)
    assert all(one.message.param2 == HOLD and one.mode == GUIDED for one in ours if one.time_s > begun_s)
