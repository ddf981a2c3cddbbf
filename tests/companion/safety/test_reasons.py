"""The texts of reasons and run phases, each once: records, ground stations and documents quote them."""

from __future__ import annotations

from enum import Enum
from string import Formatter

import pytest

from companion.safety.reasons import (
    FOR_A_PERSON,
    Activity,
    Doubt,
    EndReason,
    LatchReason,
    PowerReason,
    Reason,
    Refusal,
    RunPhase,
    SetpointFault,
    WaitReason,
)

OLD = Reason(Doubt.DATA_OLD, ("position", 1.0))
LOW = Reason(PowerReason.CHARGE, ("battery", 12))

TEXTS: list[tuple[Enum, tuple[object, ...], str]] = [
    (Doubt.STICKS_MOVED, (), "the sticks were moved"),
    (Doubt.DATA_MISSING, ("position",), "no position"),
    (Doubt.DATA_OLD, ("position", 1.0), "position silent for over 1 s"),
    (Doubt.EKF_INCOMPLETE, ("velocity",), "the autopilot's EKF has no velocity"),
    (Doubt.CLOCK_JUMPED, (), "the autopilot's clock has jumped"),
    (Doubt.LINK_LATE, (1.5,), "the link is more than 1.5 s late"),
    (Doubt.AUTOPILOT_RESTARTED, (), "the autopilot's clock has run back"),
    (Doubt.POSITION_FROZEN, (), "position stands still while the velocity says otherwise"),
    (Doubt.POSITION_WANDERS, (), "position wanders"),
    (Doubt.POSITION_WANDERED, (), "position wandered"),
    (Doubt.POSITION_JUMPED, (), "position jumped"),
    (Doubt.ORIGIN_MOVED, (), "the autopilot's EKF origin moved"),
    (Doubt.POSITION_SETTLES, (), "position has wandered and does not follow its velocity yet"),
    (Doubt.MAP_EMPTY, (), "the map has begun anew, and nothing is on it yet"),
    (Doubt.FIX_CHANGED, (), "position steps with the GPS fix"),
    (Doubt.GPS_POOR, ("RTK float", "RTK fixed"), "GPS fix RTK float, RTK fixed needed"),
    (Doubt.GPS_SILENT, (1.0,), "GPS fix not told for over 1 s"),
    (Doubt.GPS_SETTLES, ("RTK fixed", 3.0), "GPS fix RTK fixed, not yet for 3 s"),
    (Doubt.LOOP_STOOD_STILL, (), "the companion's program stood still"),
    (Doubt.LOOP_LATE, (), "the companion is too slow"),
    (Doubt.PLANNING_LONG, (30.0,), "planning has taken over 30 s"),
    (Doubt.SCAN_REPEATED, ("lidar",), "lidar repeats itself"),
    (Doubt.LIDAR_BLIND, ("lidar", 1.0), "lidar has seen nothing for over 1 s (on open ground: empty=5)"),
    (Doubt.LIDAR_LATE, ("lidar", 0.3), "lidar later than 0.3 s"),
    (Doubt.OTHER_COMPANION, (), "another companion drives this rover"),
    (Doubt.TIMEOUT_LONG, (60.0,), "GUID_TIMEOUT is 60 s: a velocity would go on for too long (set 1 to 3)"),
    (Doubt.FENCE_BREACHED, (), "the autopilot's fence is breached"),
    (Doubt.BEYOND_BORDER, ("the yard",), "the rover is beyond the border of the yard"),
    (
        Doubt.WAITED_TOO_LONG,
        (Reason(WaitReason.ARMING),),
        "waited too long for arming (asked for; the autopilot says if it refuses)",
    ),
    (SetpointFault.BEYOND_HORIZON, (), "target farther away than the horizon"),
    (SetpointFault.BEHIND_OBSTACLE, (), "target behind something"),
    (SetpointFault.ON_UNSEEN_GROUND, (), "target on ground not seen"),
    (SetpointFault.NOT_A_NUMBER, (), "velocity is not a number"),
    (SetpointFault.INTO_OBSTACLE, (), "velocity leads into something"),
    (SetpointFault.TURNS_INTO_OBSTACLE, (), "turning leads into something"),
    (SetpointFault.ONTO_UNSEEN, (), "velocity leads onto ground not seen"),
    (SetpointFault.OVER_BORDER, ("the yard",), "setpoint leads over the border of the yard"),
    (LatchReason.OTHER_MODE, ("GUIDED",), "mode is not GUIDED"),
    (LatchReason.BETWEEN_LEGS, (), "AUTO goes on by itself"),
    (LatchReason.DISARMED, (), "disarmed"),
    (LatchReason.HOLD_SENT, (), "HOLD was asked for"),
    (LatchReason.PAUSED, (), "paused on request"),
    (LatchReason.RESTARTED, (), "autopilot restarted, rover disarmed"),
    (LatchReason.HOLD_LOST, (), "the first HOLD was not taken"),
    (WaitReason.HEARTBEAT, (" on udpin:0.0.0.0:14550",), "the autopilot's heartbeat on udpin:0.0.0.0:14550"),
    (WaitReason.ORIGIN_AND_HOME, (), "the autopilot's origin and home (they come once its GPS and EKF are ready)"),
    (WaitReason.GOOD_DATA, (OLD,), "good data (position silent for over 1 s)"),
    (WaitReason.FENCE, ("",), "the autopilot's fence and rally points"),
    (
        WaitReason.OTHER_COMPANION_SILENT,
        (),
        "another companion with the same component id to fall silent",
    ),
    (WaitReason.OTHER_COMPANION_SIGNS, (), "signs of another companion (the rover is armed in GUIDED)"),
    (WaitReason.CHARGED_BATTERY, (LOW,), "a charged battery (battery at 12 %)"),
    (WaitReason.ROOM_TO_BORDER, ("2 m away",), "the rover to stand 2 m away"),
    (WaitReason.ON_THE_GRID, (), "the rover to stand on the mission's grid"),
    (
        WaitReason.REQUEST_TO_BEGIN,
        (),
        "a person to ask it to go on (a pause was asked for before the mission began)",
    ),
    (WaitReason.GUIDED, (), "GUIDED (asked for)"),
    (WaitReason.ARMING, (), "arming (asked for; the autopilot says if it refuses)"),
    (WaitReason.PERSON_STARTS_AUTO, (), "a person to arm and to set AUTO (the autopilot drives this mission)"),
    (WaitReason.PERSON_SETS_GUIDED, (), "a person to set GUIDED (somebody is driving)"),
    (WaitReason.GUARD_TELLS, (), "the guard to tell whether it has put HOLD, or a person to set GUIDED"),
    (WaitReason.PERSON_SETS_GUIDED_AGAIN, (), "a person to set GUIDED (the rover was taken over, or stopped in doubt)"),
    (WaitReason.PERSON_ARMS, (), "a person to arm (or run with --arm)"),
    (WaitReason.AUTOPILOT_HEARD, (), "the autopilot to be heard again"),
    (WaitReason.PERSON_SETS_MODE, ("AUTO",), "a person to set AUTO"),
    (WaitReason.REQUEST_TO_GO_ON, ("GUIDED",), "a person to ask it to go on, or to set GUIDED"),
    (WaitReason.PERSON_ARMS_AGAIN, (), "a person to arm"),
    (WaitReason.PERSON_SETS_MODE_AND_ARMS, ("GUIDED",), "a person to set GUIDED and arm"),
    (
        WaitReason.GOOD_DATA_AND,
        (OLD, Reason(WaitReason.PERSON_SETS_MODE, ("AUTO",))),
        "good data (position silent for over 1 s) and a person to set AUTO",
    ),
    (PowerReason.CHARGE, ("battery", 12), "battery at 12 %"),
    (PowerReason.VOLTAGE, ("battery 2", 10.9), "battery 2 at 10.9 V"),
    (PowerReason.LOW, ("battery",), "battery low for the autopilot"),
    (PowerReason.CRITICAL, ("battery",), "battery critical for the autopilot"),
    (EndReason.DONE, (), "done"),
    (EndReason.STOPPED_BY_USER, (), "stopped by the user"),
    (EndReason.TERMINATED, (), "told to end by a signal"),
    (EndReason.NOBODY_HERE, (), "nobody is here to do what the companion waits for"),
    (EndReason.NEVER_BEGINS, ("connecting",), "connecting since the start; it cannot be expected any more"),
    (EndReason.TIME_LIMIT, (), "time limit reached"),
    (EndReason.ERROR, (), "an error in the program"),
    (EndReason.GONE, (), "the companion's program is gone: killed, or crashed"),
    (EndReason.BATTERY, (LOW,), "battery at 12 %"),
    (Refusal.MALFORMED, ("no place in it",), "no place in it"),
    (Refusal.NOT_DRIVING, (Activity(RunPhase.CONNECTING),), "not driving (connecting)"),
    (Refusal.NO_POSITION, (), "no position"),
    (Refusal.RETURNING, (), "the rover is on its way back"),
    (Refusal.ENDED, (), "the mission is over"),
    (Refusal.TOO_FAR, (612, 500.0), "612 m away, farther than 500 m"),
    (Refusal.OFF_THE_GRID, (), "outside the mission's grid"),
    (Refusal.BEYOND_BORDER, ("the yard",), "beyond the yard"),
    (Refusal.NEAR_BORDER, ("2 m away",), "it must be 2 m away"),
    (Refusal.CLOSED, (), "in or too near a fence or a known obstacle"),
    (Refusal.OBSTACLE_SEEN, (), "an obstacle was seen there"),
    (
        Refusal.NOT_PAUSED,
        ("GUIDED",),
        "it was not paused by a request: set GUIDED with ground station or transmitter",
    ),
    (Refusal.NOT_HEARD, (), "the autopilot is not heard"),
    (
        Refusal.HOLD_NOT_HEARD,
        (),
        "HOLD was sent, but the autopilot is not heard: take the rover over if it moves",
    ),
    (Refusal.DISARMED, (), "the rover is disarmed"),
    (Refusal.LEGS_OF_AUTO, (), "AUTO says which target is next"),
    (Refusal.NOT_NEXT, (), "only the target after this one may be next"),
]


@pytest.mark.parametrize(("kind", "figures", "text"), TEXTS)
def test_the_text_of_a_reason(kind: Enum, figures: tuple[object, ...], text: str) -> None:
    assert str(Reason(kind, figures)) == text
    fields = [part for part in Formatter().parse(str(kind.value)) if part[1] is not None]
    assert len(fields) == len(figures), "no figure is left over"


def test_every_reason_has_its_line_here() -> None:
    kinds = (Doubt, SetpointFault, LatchReason, WaitReason, PowerReason, EndReason, Refusal)
    assert {kind for kind, _, _ in TEXTS} == {member for enum in kinds for member in enum}


SETS_MODE = Reason(WaitReason.PERSON_SETS_MODE, ("GUIDED",))


@pytest.mark.parametrize(
    ("activity", "text"),
    [
        (Activity(RunPhase.CONNECTING), "connecting"),
        (
            Activity(RunPhase.WAITING, awaited=Reason(WaitReason.ARMING)),
            "waiting for arming (asked for; the autopilot says if it refuses)",
        ),
        (Activity(RunPhase.WAITING), "waiting for "),
        (Activity(RunPhase.DRIVING), "driving"),
        (Activity(RunPhase.STAYING), "staying at the target"),
        (Activity(RunPhase.WAY_BLOCKED), "waiting for the way to clear"),
        (Activity(RunPhase.STOPPED, OLD), "stopped: position silent for over 1 s"),
        (Activity(RunPhase.STOPPED), "stopped: "),
        (
            Activity(RunPhase.STOPPED_AND_WAITING, Reason(LatchReason.DISARMED), SETS_MODE),
            "stopped: disarmed, waiting for a person to set GUIDED",
        ),
        (Activity(RunPhase.ENDED, Reason(EndReason.DONE)), "done"),
    ],
)
def test_the_text_of_an_activity(activity: Activity, text: str) -> None:
    assert str(activity) == text


@pytest.mark.parametrize("kind", list(WaitReason))
def test_a_person_is_needed_where_the_text_says_so(kind: WaitReason) -> None:
    activity = Activity(RunPhase.WAITING, awaited=Reason(kind))
    assert activity.needs_person == (kind in FOR_A_PERSON) == kind.value.startswith("a person to ")
    assert not Activity(RunPhase.DRIVING).needs_person
