"""The mode latch: whether companion or person drives, by flight mode, arming and doubts; the pilot wins. Pure.

Nouns: mode latch, verdict, reaction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum, StrEnum, auto

from companion.safety.reasons import WAITED_OUT, Doubt, LatchReason, Reason, WaitReason
from companion.safety.watchdogs import data_doubt
from companion.settings import SafetySettings
from companion.vehicle.state import VehicleState

HOLD_AGAIN_S = 2.0
"""A heartbeat that still shows GUIDED this long after our HOLD means that HOLD never arrived."""


class Control(StrEnum):
    """Who drives."""

    NOBODY = "nobody"
    """The companion has not had the rover yet."""
    COMPANION = "companion"
    PERSON = "person"
    """A person (or a failsafe) took over: the companion is silent until the mode is GUIDED again."""


@dataclass(frozen=True, slots=True)
class LatchState:
    """The state of the latch."""

    control: Control = Control.NOBODY
    unsafe_since_s: float | None = None
    hold_sent: bool = False
    hold_s: float = math.inf
    """When HOLD was sent."""


class Reaction(Enum):
    """What the companion does in this tick."""

    SILENT = auto()
    DRIVE = auto()
    STOP = auto()
    HOLD = auto()


@dataclass(frozen=True, slots=True)
class Verdict:
    """The reaction and its reason; None when the rover may be driven, or when nobody has had it yet."""

    reaction: Reaction
    reason: Reason[Enum] | None = None


def latched(control: Control, vehicle: VehicleState) -> Control:
    """Who drives, by the mode: in GUIDED (or on a leg that AUTO hands over) the companion; out of it a person."""
    if vehicle.is_ours:
        return Control.COMPANION
    return Control.NOBODY if control is Control.NOBODY else Control.PERSON


def check(
    latch: LatchState, vehicle: VehicleState, now_s: float, settings: SafetySettings, doubt: Reason[Doubt] | None
) -> tuple[LatchState, Verdict]:
    """One tick of the latch. ``doubt``: what the monitors say; None when the rover may move.

    Setpoints may be sent only on DRIVE and STOP. After ``hold_after_s`` of doubt, and at once when the sticks were
    moved, it answers HOLD once; then it is silent until a person puts the vehicle back into GUIDED. Doubts that are
    waited out never lead to HOLD.
    """
    control = latched(latch.control, vehicle)
    heartbeat = vehicle.heartbeat
    if heartbeat is None or control is not Control.COMPANION:
        return LatchState(control), Verdict(Reaction.SILENT, None if control is Control.NOBODY else _not_ours(vehicle))
    if latch.hold_sent:
        # The heartbeat may still show GUIDED just after our own HOLD: wait until it has left GUIDED.
        if heartbeat.armed and heartbeat.time_s >= latch.hold_s + HOLD_AGAIN_S:
            return replace(latch, hold_s=now_s), Verdict(Reaction.HOLD, Reason(LatchReason.HOLD_LOST))
        return latch, Verdict(Reaction.SILENT, Reason(LatchReason.HOLD_SENT))
    safe = replace(latch, control=control, unsafe_since_s=None)
    if not heartbeat.armed:
        return safe, Verdict(Reaction.SILENT, Reason(LatchReason.DISARMED))
    if doubt is None:
        return safe, Verdict(Reaction.DRIVE)
    if doubt.kind in WAITED_OUT:
        return safe, Verdict(Reaction.STOP, doubt)
    since_s = now_s if latch.unsafe_since_s is None else latch.unsafe_since_s
    if doubt.kind is Doubt.STICKS_MOVED or now_s - since_s >= settings.hold_after_s:
        return LatchState(Control.PERSON, hold_sent=True, hold_s=now_s), Verdict(Reaction.HOLD, doubt)
    return replace(safe, unsafe_since_s=since_s), Verdict(Reaction.STOP, doubt)


def awaited(vehicle: VehicleState, now_s: float, settings: SafetySettings) -> Reason[WaitReason] | None:
    """What a companion that has fallen silent waits for, so that a person knows what to do; None for nothing.

    A rover that has been disarmed (its autopilot has restarted, for example) is never armed by this run again.
    """
    heartbeat, mode = vehicle.heartbeat, vehicle.own_mode
    if heartbeat is None or now_s - heartbeat.time_s > settings.heartbeat_s:
        return Reason(WaitReason.AUTOPILOT_HEARD)
    if heartbeat.mode == mode and heartbeat.armed:
        return None
    if heartbeat.mode == mode:
        person = Reason(WaitReason.PERSON_ARMS_AGAIN)
    elif heartbeat.armed:
        person = Reason(WaitReason.PERSON_SETS_MODE, (mode.name,))
    else:
        person = Reason(WaitReason.PERSON_SETS_MODE_AND_ARMS, (mode.name,))
    data = data_doubt(vehicle, now_s, settings)
    return person if data is None else Reason(WaitReason.GOOD_DATA_AND, (data, person))


def _not_ours(vehicle: VehicleState) -> Reason[LatchReason]:
    """Why the companion must not steer a vehicle that is not ours, by the mode."""
    heartbeat = vehicle.heartbeat
    if heartbeat is not None and heartbeat.mode == vehicle.own_mode:
        # In GUIDED the rover would be ours: this is AUTO.
        return Reason(LatchReason.BETWEEN_LEGS)
    return Reason(LatchReason.OTHER_MODE, (vehicle.own_mode.name,))
